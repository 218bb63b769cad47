"""Scans that repeat another: the same speckle, seen again from the same place, is no second witness.

While nothing moves, speckle is frozen, and each turn of the sonar errs as the turn before did.  Of such scans one draws
the map.  A few centimetres of drift make the grain new, and with it what the scan says.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from mapping.compass import wrap
from mapping.rest import FROZEN, GRAIN_LEVEL, GRAIN_M
from mapping.values import Pose, Scan

SAME_M: Final = 0.1
"""Scans farther from each other than this have their own grain: it changes within centimetres."""
SAME_RAD: Final = math.radians(10.0)

Floats = NDArray[np.float64]
Rested = tuple[Pose, Scan]


class Repeats:
    """Remembers which scans repeat which; scans are told apart by their indices."""

    def __init__(self) -> None:
        self._known: dict[tuple[int, int], bool] = {}

    def fresh(self, rested: Sequence[Rested]) -> list[int]:
        """Tell which of some scans draw, by their places in the sequence: of those alike the one with most beams."""
        order = sorted(range(len(rested)), key=lambda k: (-len(rested[k][1].bearing_rad), k))
        kept: list[int] = []
        for k in order:
            if not any(self._repeats(rested[j], rested[k]) for j in kept):
                kept.append(k)
        return sorted(kept)

    def _repeats(self, one: Rested, other: Rested) -> bool:
        (at, scan), (pose, again) = one, other
        if math.hypot(pose.x_m - at.x_m, pose.y_m - at.y_m) > SAME_M:
            return False
        pair = (scan.index, again.index)
        if pair not in self._known:
            self._known[pair] = same_grain(scan, again, wrap(pose.heading_rad - at.heading_rad))
        return self._known[pair]


def same_grain(one: Scan, other: Scan, turn_rad: float) -> bool:
    """Whether two scans show the same speckle; ``turn_rad`` is how far ``other`` was turned against ``one``."""
    alike = one.bin_m == other.bin_m and one.echoes.shape[1] == other.echoes.shape[1]
    if not alike or abs(turn_rad) > SAME_RAD or not len(one.bearing_rad) or not len(other.bearing_rad):
        return False
    off = (other.bearing_rad[:, None] + turn_rad - one.bearing_rad[None, :] + math.pi) % (2.0 * math.pi) - math.pi
    nearest = np.abs(off).argmin(axis=1)
    seen = np.abs(off)[np.arange(len(nearest)), nearest] <= 0.5 * one.step_rad
    (a, loud_a), (b, loud_b) = _grain(one, nearest[seen]), _grain(other, np.flatnonzero(seen))
    told = loud_a | loud_b
    a, b = a[told], b[told]
    energy = float(np.sqrt((a @ a) * (b @ b)))
    return energy > 0.0 and float(a @ b) > FROZEN * energy


def _grain(scan: Scan, beams: NDArray[np.intp]) -> tuple[Floats, NDArray[np.bool_]]:
    """Speckle of some beams ``(k, bins)`` without what all bearings show, and where they are loud."""
    echoes = scan.echoes.astype(np.float64)
    mean = uniform_filter1d(echoes, max(3, round(GRAIN_M / scan.bin_m)), axis=1, mode="constant")
    grain = echoes - mean
    return (grain - np.median(grain, axis=0))[beams], (mean > GRAIN_LEVEL)[beams]
