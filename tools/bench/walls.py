"""True walls in plan: how far a point is from them, and which stretches were in view."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

SAMPLE_M: Final = 0.05
_OWN_WALL: Final = 1e-3

Line = tuple[NDArray[np.float64], bool]
"""Points ``(n, 2)`` of a polyline in m, and whether its last point joins the first."""


def distance_to_walls_m(points_m: NDArray[np.float64], lines: Sequence[Line]) -> NDArray[np.float64]:
    """Distance ``(n,)`` in m of points ``(n, 2)`` from the nearest wall."""
    starts, ends = _segments(lines)
    along = ends - starts
    length2 = np.maximum(np.sum(along**2, axis=1), 1e-12)
    nearest = np.full(len(points_m), np.inf)
    for index, point in enumerate(points_m):
        share = np.clip(np.sum((point - starts) * along, axis=1) / length2, 0.0, 1.0)
        nearest[index] = np.min(np.linalg.norm(starts + share[:, None] * along - point, axis=1))
    return nearest


def walls_in_view_m(lines: Sequence[Line], seen_from_m: NDArray[np.float64], range_m: float) -> NDArray[np.float64]:
    """Points ``(n, 2)`` every 5 cm of wall that are in view from one of the places ``(k, 2)``, within ``range_m``."""
    starts, ends = _segments(lines)
    samples = np.concatenate([_along(start, end) for start, end in zip(starts, ends, strict=True)])
    in_view = np.zeros(len(samples), dtype=bool)
    for place in seen_from_m:
        near = np.linalg.norm(samples - place, axis=1) <= range_m
        blocked = np.array(
            [_is_blocked(place, sample, starts, ends) for sample in samples[near & ~in_view]], dtype=bool
        )
        todo = np.nonzero(near & ~in_view)[0]
        in_view[todo[~blocked]] = True
    return np.asarray(samples[in_view])


def _segments(lines: Sequence[Line]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    starts, ends = [], []
    for points, closed in lines:
        starts.append(points if closed else points[:-1])
        ends.append(np.roll(points, -1, axis=0) if closed else points[1:])
    return np.concatenate(starts), np.concatenate(ends)


def _along(start: NDArray[np.float64], end: NDArray[np.float64]) -> NDArray[np.float64]:
    count = max(1, round(float(np.linalg.norm(end - start)) / SAMPLE_M))
    share = (np.arange(count) + 0.5) / count
    return np.asarray(start + share[:, None] * (end - start))


def _is_blocked(
    place: NDArray[np.float64], sample: NDArray[np.float64], starts: NDArray[np.float64], ends: NDArray[np.float64]
) -> bool:
    ray, along, apart = sample - place, ends - starts, starts - place
    turn = ray[0] * along[:, 1] - ray[1] * along[:, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        on_ray = (apart[:, 0] * along[:, 1] - apart[:, 1] * along[:, 0]) / turn
        on_wall = (apart[:, 0] * ray[1] - apart[:, 1] * ray[0]) / turn
    hits = (on_ray > 0) & (on_ray < 1 - _OWN_WALL) & (on_wall >= 0) & (on_wall <= 1)
    return bool(np.any(hits))
