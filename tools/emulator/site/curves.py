"""Smooth courses through given points, and the walls beside them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from tools.emulator.site.values import Points

_STEP: Final = 0.04
"""Points along a course, as a share of the way between the points that it goes through."""


@dataclass(frozen=True, slots=True)
class Curve:
    """A course in plan.

    ``points_m`` ``(n, 2)``, ``right`` ``(n, 2)`` the unit vectors to its right, ``distance_m`` ``(n,)`` the way from
    its beginning.
    """

    points_m: Points
    right: Points
    distance_m: Points

    def at(self, distance_m: float, right_m: float) -> tuple[float, float, float]:
        """Return the place so far along and beside the course, and the course there in degrees from north."""
        x, y, east, north = (
            float(np.interp(distance_m, self.distance_m, column)) for column in (*self.points_m.T, *self.right.T)
        )
        return x + right_m * east, y + right_m * north, float(np.degrees(np.arctan2(-north, east)) % 360.0)


def smooth(through: Sequence[tuple[float, float]], *, closed: bool) -> Curve:
    """Return the Catmull-Rom curve through points; a closed one does not repeat its first point."""
    points = np.array(through, dtype=np.float64)
    if closed:
        knots = np.concatenate([points[-1:], points, points[:2]])
    else:
        knots = np.concatenate([2 * points[:1] - points[1:2], points, 2 * points[-1:] - points[-2:-1]])
    share = np.arange(0.0, 1.0 - 1e-9, _STEP)[:, None]
    pieces = [_piece(knots[index : index + 4], share) for index in range(len(knots) - 3)]
    path = np.concatenate(pieces if closed else [*pieces, points[-1:]])
    along = (np.roll(path, -1, axis=0) - np.roll(path, 1, axis=0)) if closed else np.gradient(path, axis=0)
    along /= np.linalg.norm(along, axis=1)[:, None]
    way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
    return Curve(path, np.stack([along[:, 1], -along[:, 0]], axis=1), way)


def beside(course: Curve, right_m: Points) -> Points:
    """Return the points ``(n, 2)`` at distances ``right_m`` ``(n,)`` to the right of a course."""
    return np.asarray(course.points_m + right_m[:, None] * course.right, dtype=np.float64)


def _piece(knots: Points, share: Points) -> Points:
    before, start, end, after = knots
    square, cube = share**2, share**3
    linear = (end - before) * share
    bend = (2 * before - 5 * start + 4 * end - after) * square
    twist = (3 * start - 3 * end + after - before) * cube
    return np.asarray(start + (linear + bend + twist) / 2, dtype=np.float64)
