"""Readings: what a sonar or a feed said, in SI units, at a time.

Angles follow the compass everywhere in lacuna: radians, clockwise seen from above.  A direction ``a`` from north
points to ``(sin a, cos a)`` in map axes (x east, y north).  ``t_ns`` is integer nanoseconds of one monotonic clock,
of the moment that the reading is of, as well as the arrival of its first byte tells it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Quality = Literal["good", "suspect", "bad"]
"""How far a reading is to be trusted: ``suspect`` ones are used and shown, ``bad`` ones are counted and shown only."""


@dataclass(frozen=True, slots=True)
class HeadSettings:
    """How the head was set when it made a ping, as its own reply tells.

    ``range_m`` is the head's label; the true length of a ping is ``bin_m`` times the number of bins.
    ``left_rad`` and ``right_rad`` are the sector's limits, clockwise from the bow, equal for a full circle.
    """

    range_m: float
    gain_pct: float
    ad_low_db: float
    ad_span_db: float
    step_rad: float
    continuous: bool
    left_rad: float
    right_rad: float
    clockwise: bool


@dataclass(frozen=True, slots=True)
class Ping:
    """One beam of the sonar; ``t_ns`` is when its sound went out.

    ``bearing_rad`` is clockwise from the bow in [0, 2 pi).  ``echoes`` is ``(n_bins,)`` uint8, 0 to 255 for 0 to 80 dB,
    read-only; bin ``i`` covers ranges ``i * bin_m`` to ``(i + 1) * bin_m``.
    """

    t_ns: int
    bearing_rad: float
    bin_m: float
    echoes: NDArray[np.uint8]
    head: HeadSettings


@dataclass(frozen=True, slots=True)
class Heading:
    """Heading of the vehicle, clockwise from the configured north, in [0, 2 pi)."""

    t_ns: int
    heading_rad: float
    source: str
    quality: Quality = "good"
    reason: str = ""


@dataclass(frozen=True, slots=True)
class Depth:
    """Depth of the vehicle below the water surface, positive down."""

    t_ns: int
    depth_m: float
    source: str
    quality: Quality = "good"
    reason: str = ""


@dataclass(frozen=True, slots=True)
class Altitude:
    """Height of the vehicle above the floor."""

    t_ns: int
    altitude_m: float
    source: str
    quality: Quality = "good"
    reason: str = ""


@dataclass(frozen=True, slots=True)
class Odometry:
    """Displacement of the vehicle in the ``dt_s`` before ``t_ns``.

    ``dx_m`` and ``dy_m`` are to starboard and ahead where ``in_vehicle``, else east and north of the configured north.
    ``sd_m`` is the standard deviation of each; those of successive displacements add up, for what is wrong in an
    instrument (its scale, how it is mounted) stays wrong.
    """

    t_ns: int
    dt_s: float
    dx_m: float
    dy_m: float
    sd_m: float
    in_vehicle: bool
    source: str
    quality: Quality = "good"
    reason: str = ""


Reading = Ping | Heading | Depth | Altitude | Odometry


def is_usable(reading: Reading) -> bool:
    """Tell whether a map may be made of a reading: its device, or what came before it, do not speak against it."""
    return isinstance(reading, Ping) or reading.quality != "bad"
