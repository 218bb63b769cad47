"""Snapshots: what the program tells others, as values.

A snapshot is a topic, the fields of its header and its named arrays.  ``daemon.wire`` turns it into frames for ZeroMQ.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from numpy.typing import NDArray

from drivers.records import Json


@dataclass(frozen=True, slots=True)
class Snapshot:
    """One message to be published: ``arrays`` keep their order on the wire."""

    topic: str
    t_ns: int
    utc_ns: int
    fields: dict[str, Json]
    arrays: dict[str, NDArray[Any]] = field(default_factory=dict)
