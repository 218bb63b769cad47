"""Swinging the compass: what the registered headings of the stations say of its deviation.

A compass near iron reads off by an amount that goes with the heading: a bias, one cycle to the turn (hard iron) and
two (soft iron).  Every placed station has a heading from its walls; its difference from what the compass said is a
sample of that curve.  The map's own north is what the compass said at its first station, so an error that is the same
at all headings turns the whole map and cannot be seen in it: what is told as bias is against the north of the map.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from mapping.compass import SHARES, waves_of, wrap
from mapping.prior import Prior
from mapping.values import Station

USUAL_SD_RAD: Final = math.radians(4.0)
NOISE_RAD: Final = math.radians(1.0)
"""How far a compass wanders about its curve, and a registered heading about the truth."""
LET_GO: Final = 3.0
"""Beyond so many standard deviations a station counts less: iron nearby, not the vehicle's own."""
DISTURBED_RAD: Final = math.radians(8.0)
"""A compass farther than this off its curve is disturbed."""
ROUNDS: Final = 12
SUSPECT: Final = 1.25
"""A scan that fits only so many standard deviations off its compass may lie quite otherwise."""

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Swing:
    """The compass's curve: what to add to its heading to have the map's.

    ``waves`` ``(5,)`` in radians are a constant and the amplitudes of the sine and the cosine of the heading and of
    twice the heading; ``covariance`` ``(5, 5)`` is theirs.  ``off_rad`` ``(n,)`` is what each station is off the curve.
    """

    waves: Floats
    covariance: Floats
    off_rad: Floats

    def at(self, compass_rad: float) -> tuple[float, float]:
        """Return what to add to a heading as read, and its standard deviation."""
        row = waves_of(np.array([compass_rad]))[0]
        return float(row @ self.waves), math.sqrt(float(row @ self.covariance @ row))

    @property
    def bias_rad(self) -> float:
        """How far the compass reads off the map's north on average over all headings, clockwise positive."""
        return -wrap(float(self.waves[0]))

    @property
    def bias_sd_rad(self) -> float:
        """Standard deviation of the bias."""
        return math.sqrt(float(self.covariance[0, 0]))

    @property
    def deviation_rad(self) -> tuple[float, float]:
        """Largest deviation from the bias at any heading, and its standard deviation."""
        design = waves_of(np.radians(np.arange(0.0, 360.0, 5.0)))
        design[:, 0] = 0.0
        most = int(np.abs(design @ self.waves).argmax())
        sd = math.sqrt(float(design[most] @ self.covariance @ design[most]))
        return float(abs(design[most] @ self.waves)), sd

    @property
    def is_disturbed(self) -> NDArray[np.bool_]:
        """Which stations' compass was off its curve, ``(n,)``: iron nearby."""
        return np.asarray(np.abs(self.off_rad) > DISTURBED_RAD)


def swing_of(stations: Sequence[Station]) -> tuple[Swing, tuple[Station, ...]]:
    """Find the compass's curve from the stations of the map that had a compass, and return them too."""
    told = tuple(s for s in stations if s.status == "placed" and s.scan.has_compass)
    return swung([s.scan.heading_rad for s in told], [s.pose.heading_rad for s in told]), told


def swung(read_rad: Sequence[float], heading_rad: Sequence[float], compass_sd_rad: float = USUAL_SD_RAD) -> Swing:
    """Find the compass's curve from headings as read and as registered: robust, about what is known before."""
    read = np.array(read_rad, dtype=np.float64)
    first = heading_rad[0] - read_rad[0] if len(read) else 0.0
    add = np.array([wrap(h - r - first) for h, r in zip(heading_rad, read_rad, strict=True)], dtype=np.float64)
    middle = float(np.median(add)) if len(add) else 0.0
    design, off = waves_of(read), add - middle
    known = np.diag(1.0 / (compass_sd_rad * np.array(SHARES)) ** 2)
    for _ in range(ROUNDS):
        weight = (1.0 + (off / (LET_GO * NOISE_RAD)) ** 2) ** -2 / NOISE_RAD**2
        covariance = np.asarray(np.linalg.inv((design * weight[:, None]).T @ design + known), dtype=np.float64)
        waves = np.asarray(covariance @ (design.T @ (weight * (add - middle))), dtype=np.float64)
        off = np.asarray(add - middle - design @ waves, dtype=np.float64)
    waves[0] += middle + first
    return Swing(waves, covariance, off)


def is_turned(heading_rad: float, prior: Prior) -> bool:
    """Whether a scan fits so far off its compass that the compass is in doubt."""
    return abs(wrap(heading_rad - prior.heading_rad)) > SUSPECT * prior.heading_sd_rad
