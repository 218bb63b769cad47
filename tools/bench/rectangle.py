"""Fitting the four walls of a rectangular room to points, to judge a map of a tank."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

BIN_M: Final = 0.05
NEAR_M: Final = 0.10
LEAST_SIDE_M: Final = 1.0


@dataclass(frozen=True, slots=True)
class Rectangle:
    """Four walls, each a line of its own: ``normal_rad`` ``(4,)`` and ``offset_m`` ``(4,)`` with n . p = offset.

    Walls 0 and 1 face each other, so do 2 and 3.
    """

    normal_rad: NDArray[np.float64]
    offset_m: NDArray[np.float64]

    def distance_m(self, points_m: NDArray[np.float64]) -> NDArray[np.float64]:
        """Distance ``(n,)`` in m of points ``(n, 2)`` from the nearest of the four walls' stretches."""
        corners = self.corners_m()
        starts = corners
        ends = np.roll(corners, -1, axis=0)
        along = ends - starts
        relative = points_m[:, None, :] - starts[None]
        share = np.clip(np.sum(relative * along, axis=2) / np.sum(along**2, axis=1), 0.0, 1.0)
        nearest = starts[None] + share[:, :, None] * along[None]
        return np.asarray(np.min(np.linalg.norm(points_m[:, None, :] - nearest, axis=2), axis=1))

    def corners_m(self) -> NDArray[np.float64]:
        """Corners ``(4, 2)`` in m, in order around the room."""
        order = ((0, 2), (2, 1), (1, 3), (3, 0))
        normals = np.stack([np.cos(self.normal_rad), np.sin(self.normal_rad)], axis=1)
        return np.array([np.linalg.solve(normals[[a, b]], self.offset_m[[a, b]]) for a, b in order])

    @property
    def sides_m(self) -> tuple[float, float]:
        """Mean length in m of each pair of opposite walls."""
        corners = self.corners_m()
        lengths = np.linalg.norm(np.roll(corners, -1, axis=0) - corners, axis=1)
        return float((lengths[0] + lengths[2]) / 2), float((lengths[1] + lengths[3]) / 2)


def fit_rectangle(points_m: NDArray[np.float64]) -> Rectangle | None:
    """Fit four walls to points ``(n, 2)`` in m; None where there are too few points for four walls.

    First the angle and the two pairs of parallel lines with the most points near them, then each line for itself by
    total least squares, so that the fit does not assume right angles.
    """
    if len(points_m) < 8:
        return None
    best = max(
        (_at_angle(points_m, angle) for angle in np.radians(np.arange(0.0, 90.0, 0.5))), key=lambda found: found[0]
    )
    _, angle, (west, east), (south, north) = best
    across = angle + np.pi / 2
    rough = Rectangle(np.array([angle, angle, across, across]), np.array([west, east, south, north]))
    return _refine(points_m, rough)


def _at_angle(
    points_m: NDArray[np.float64], angle: float
) -> tuple[int, float, tuple[float, float], tuple[float, float]]:
    u = points_m @ np.array([np.cos(angle), np.sin(angle)])
    v = points_m @ np.array([-np.sin(angle), np.cos(angle)])
    count_u, pair_u = _two_lines(u)
    count_v, pair_v = _two_lines(v)
    return count_u + count_v, angle, pair_u, pair_v


def _two_lines(values: NDArray[np.float64]) -> tuple[int, tuple[float, float]]:
    edges = np.arange(values.min() - BIN_M, values.max() + 2 * BIN_M, BIN_M)
    counts, _ = np.histogram(values, edges)
    smooth = np.convolve(counts, [1, 1, 1], mode="same")
    centres = (edges[:-1] + edges[1:]) / 2
    first = int(np.argmax(smooth))
    apart = np.where(np.abs(centres - centres[first]) >= LEAST_SIDE_M, smooth, 0)
    second = int(np.argmax(apart))
    low, high = sorted((float(centres[first]), float(centres[second])))
    return int(smooth[first] + apart[second]), (low, high)


def _refine(points_m: NDArray[np.float64], rough: Rectangle) -> Rectangle:
    normal_rad, offset_m = rough.normal_rad.copy(), rough.offset_m.copy()
    normals = np.stack([np.cos(normal_rad), np.sin(normal_rad)], axis=1)
    apart_m = np.abs(points_m @ normals.T - offset_m)
    for wall in range(4):
        # Points near a corner belong to two walls and would bend both.
        beside = (2, 3) if wall < 2 else (0, 1)
        near = points_m[(apart_m[:, wall] < 2 * NEAR_M) & np.all(apart_m[:, beside] > 3 * NEAR_M, axis=1)]
        if len(near) < 4:
            continue
        centre = near.mean(axis=0)
        refined = np.linalg.svd(near - centre)[2][1]
        refined = refined if refined @ normals[wall] > 0 else -refined
        if refined @ normals[wall] > np.cos(np.radians(10)):
            normal_rad[wall] = np.arctan2(refined[1], refined[0])
            offset_m[wall] = float(refined @ centre)
    return Rectangle(normal_rad, offset_m)
