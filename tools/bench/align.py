"""Rigid alignment of a map with the truth: the map frame starts at the first station and at the compass's north."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi, tau

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True)
class Alignment:
    """A turn (clockwise, rad) and a shift ``(2,)`` (m) that bring points of the map to their true places."""

    clockwise_rad: float
    shift_m: NDArray[np.float64]

    def apply(self, points_m: NDArray[np.float64]) -> NDArray[np.float64]:
        """Turn and shift points ``(n, 2)`` in m."""
        return _turned(points_m, self.clockwise_rad) + self.shift_m


def align(found_m: NDArray[np.float64], true_m: NDArray[np.float64], turn_rad: float) -> Alignment:
    """Find the rigid motion with the least squared distance (Umeyama 1991, without scale).

    Points are ``(n, 2)`` in m.  ``turn_rad`` is used where fewer than three points tell no turn of their own.
    """
    if len(found_m) >= 3:
        a, b = found_m - found_m.mean(axis=0), true_m - true_m.mean(axis=0)
        # Counter-clockwise turn from a to b is atan2(sum of cross products, sum of dot products); ours is clockwise.
        cross = float(np.sum(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]))
        turn_rad = -float(np.arctan2(cross, float(np.sum(a * b))))
    return Alignment(turn_rad, true_m.mean(axis=0) - _turned(found_m, turn_rad).mean(axis=0))


def angle_between(from_rad: float, to_rad: float) -> float:
    """Turn that leads from one direction to the other, in [-pi, pi)."""
    return (to_rad - from_rad + pi) % tau - pi


def _turned(points_m: NDArray[np.float64], clockwise_rad: float) -> NDArray[np.float64]:
    cos, sin = np.cos(clockwise_rad), np.sin(clockwise_rad)
    return np.asarray(points_m @ np.array([[cos, -sin], [sin, cos]]))
