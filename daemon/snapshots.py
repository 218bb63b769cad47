"""Snapshots: what the program tells others, as values; one function a topic.

A snapshot is a topic, the fields of its header and its named arrays.  ``daemon.wire`` turns it into frames for ZeroMQ.
Headers are for people and other programs: degrees, metres, compass angles clockwise from north; what is not known is
null.  Rows of grids run south to north: row 0 is the southmost.  The snapshots of the map are in ``daemon.mapshots``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

from numpy.typing import NDArray

from drivers.readings import Ping
from drivers.records import Event, Json


@dataclass(frozen=True, slots=True)
class Snapshot:
    """One message to be published: ``arrays`` keep their order on the wire."""

    topic: str
    t_ns: int
    utc_ns: int
    fields: dict[str, Json]
    arrays: dict[str, NDArray[Any]] = field(default_factory=dict)


def ping(reading: Ping, utc_ns: int, heading_rad: float | None, depth_m: float | None) -> Snapshot:
    """Return one beam: array ``echoes`` ``(n_bins,)`` u1; ``heading_deg`` and ``depth_m`` as told last, or null."""
    fields: dict[str, Json] = {
        "bearing_deg": degrees(reading.bearing_rad),
        "heading_deg": None if heading_rad is None else degrees(heading_rad),
        "depth_m": number(depth_m),
        "bin_m": reading.bin_m,
        "range_m": reading.bin_m * len(reading.echoes),
        "step_deg": degrees(reading.head.step_rad),
        "gain_pct": reading.head.gain_pct,
    }
    return Snapshot("ping", reading.t_ns, utc_ns, fields, {"echoes": reading.echoes})


def event(record: Event) -> Snapshot:
    """Return an event as it stands in the log: its ``kind`` and, under ``fields``, what it tells."""
    return Snapshot("event", record.t_ns, record.utc_ns, {"kind": record.kind, "fields": record.fields})


def health(t_ns: int, utc_ns: int, fields: dict[str, Json]) -> Snapshot:
    """Return how the program does: ports, rates, losses, queue, disk, lag, versions."""
    return Snapshot("health", t_ns, utc_ns, fields)


def number(value: float | None, digits: int = 9) -> float | None:
    """Return ``value`` rounded, or None where it is not a finite number: JSON has no nan."""
    return None if value is None or not math.isfinite(value) else round(float(value), digits)


def degrees(angle_rad: float) -> float | None:
    """Return an angle for people."""
    return number(math.degrees(angle_rad), 6)
