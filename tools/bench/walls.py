"""True walls in plan: how far a point is from them, and which stretches were in view."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

SAMPLE_M: Final = 0.05
_OWN_WALL: Final = 1e-3

Floats = NDArray[np.float64]
Line = tuple[Floats, bool]
"""Points ``(n, 2)`` of a polyline in m, and whether its last point joins the first."""


def distance_to_walls_m(points_m: Floats, lines: Sequence[Line]) -> Floats:
    """Distance ``(n,)`` in m of points ``(n, 2)`` from the nearest wall."""
    starts, ends = _segments(lines)
    along = ends - starts
    length2 = np.maximum(np.sum(along**2, axis=1), 1e-12)
    nearest = np.full(len(points_m), np.inf)
    for index, point in enumerate(points_m):
        share = np.clip(np.sum((point - starts) * along, axis=1) / length2, 0.0, 1.0)
        nearest[index] = np.min(np.linalg.norm(starts + share[:, None] * along - point, axis=1))
    return nearest


def sampled(lines: Sequence[Line]) -> Floats:
    """Points ``(n, 2)`` every 5 cm of wall."""
    starts, ends = _segments(lines)
    return np.concatenate([_along(start, end) for start, end in zip(starts, ends, strict=True)])


def in_view(samples_m: Floats, lines: Sequence[Line], place_m: Floats, range_m: float) -> NDArray[np.bool_]:
    """Tell which samples ``(n, 2)`` of walls are in view from a place ``(2,)``, within ``range_m``."""
    starts, ends = _segments(lines)
    near = np.linalg.norm(samples_m - place_m, axis=1) <= range_m
    seen = np.zeros(len(samples_m), dtype=bool)
    seen[near] = [not _is_blocked(place_m, sample, starts, ends) for sample in samples_m[near]]
    return seen


def _segments(lines: Sequence[Line]) -> tuple[Floats, Floats]:
    starts, ends = [], []
    for points, closed in lines:
        starts.append(points if closed else points[:-1])
        ends.append(np.roll(points, -1, axis=0) if closed else points[1:])
    return np.concatenate(starts), np.concatenate(ends)


def _along(start: Floats, end: Floats) -> Floats:
    count = max(1, round(float(np.linalg.norm(end - start)) / SAMPLE_M))
    share = (np.arange(count) + 0.5) / count
    return np.asarray(start + share[:, None] * (end - start))


def _is_blocked(place: Floats, sample: Floats, starts: Floats, ends: Floats) -> bool:
    ray, along, apart = sample - place, ends - starts, starts - place
    turn = ray[0] * along[:, 1] - ray[1] * along[:, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        on_ray = (apart[:, 0] * along[:, 1] - apart[:, 1] * along[:, 0]) / turn
        on_wall = (apart[:, 0] * ray[1] - apart[:, 1] * ray[0]) / turn
    hits = (on_ray > 0) & (on_ray < 1 - _OWN_WALL) & (on_wall >= 0) & (on_wall <= 1)
    return bool(np.any(hits))
