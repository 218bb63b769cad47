"""Rays in plan: the first wall along each, and the walls met after mirror-like bounces."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tools.emulator.site import Wall

Floats = NDArray[np.float64]

NOTHING_M = 1e4
"""Range of a ray that meets no wall."""

_CLEAR_M = 1e-6


@dataclass(frozen=True, slots=True)
class Segments:
    """Walls as straight pieces: all ``(s, 2)`` float64, ``normal`` of unit length (either side)."""

    start: Floats
    along: Floats
    normal: Floats
    centre: Floats

    @classmethod
    def of(cls, walls: Sequence[Wall]) -> Segments:
        """Cut polylines into their pieces; pieces of no length are left out."""
        starts, ends = [], []
        for wall in walls:
            points = wall.points_m
            starts.append(points if wall.closed else points[:-1])
            ends.append(np.roll(points, -1, axis=0) if wall.closed else points[1:])
        start, end = np.concatenate(starts), np.concatenate(ends)
        along = end - start
        length = np.hypot(along[:, 0], along[:, 1])
        keep = length > _CLEAR_M
        start, along, length = start[keep], along[keep], length[keep]
        normal = np.stack([-along[:, 1], along[:, 0]], axis=1) / length[:, None]
        return cls(start, along, normal, start + along / 2)


@dataclass(frozen=True, slots=True)
class Hits:
    """What rays meet, all ``(n,)``: way from the ray's origin in m, piece of wall, cosine of incidence (0 to 1).

    ``point_m`` ``(n, 2)`` is the place that is met.  A ray that meets nothing has ``way_m`` of ``NOTHING_M``.
    """

    way_m: Floats
    segment: NDArray[np.intp]
    cosine: Floats
    point_m: Floats


def cast(segments: Segments, origin: Floats, direction: Floats) -> Hits:
    """Find the first wall along rays; ``origin`` and ``direction`` are ``(n, 2)`` or broadcast to it."""
    across = np.stack([segments.along[:, 1], -segments.along[:, 0]])
    beside = np.stack([-segments.start[:, 1], segments.start[:, 0]])
    cross = direction @ across
    own = origin[:, 0] * direction[:, 1] - origin[:, 1] * direction[:, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        way = ((segments.start * across.T).sum(axis=1) - origin @ across) / cross
        share = (direction @ beside - own[:, None]) / cross
        way[~((share >= 0.0) & (share <= 1.0) & (way > _CLEAR_M))] = NOTHING_M
    first = way.argmin(axis=1)
    rows = np.arange(len(first))
    cosine = np.abs((direction * segments.normal[first]).sum(axis=1))
    met = way[rows, first]
    return Hits(met, first, cosine, origin + direction * met[:, None])


def trace(segments: Segments, origin: Floats, angle_rad: Floats, bounces: int) -> list[Hits]:
    """Follow rays from ``origin`` ``(2,)`` along compass angles through mirror-like bounces.

    Returns one ``Hits`` for the direct way and one for each bounce; ``way_m`` is the whole way, unfolded.
    """
    direction = np.stack([np.sin(angle_rad), np.cos(angle_rad)], axis=1)
    place = np.broadcast_to(origin, direction.shape)
    behind = np.zeros(len(angle_rad))
    answers: list[Hits] = []
    for _ in range(bounces + 1):
        hits = cast(segments, place, direction)
        answers.append(Hits(np.minimum(behind + hits.way_m, NOTHING_M), hits.segment, hits.cosine, hits.point_m))
        normal = segments.normal[hits.segment]
        place = hits.point_m
        direction = direction - 2.0 * (direction * normal).sum(axis=1)[:, None] * normal
        behind = behind + hits.way_m
    return answers


def corners(walls: Sequence[Wall], least_turn_rad: float = 0.9) -> Floats:
    """Return the points ``(k, 2)`` where walls turn sharply enough to answer as a corner."""
    found = [np.empty((0, 2))]
    for wall in walls:
        points = wall.points_m
        back = points - np.roll(points, 1, axis=0)
        ahead = np.roll(points, -1, axis=0) - points
        turn = np.arctan2(back[:, 0] * ahead[:, 1] - back[:, 1] * ahead[:, 0], (back * ahead).sum(axis=1))
        sharp = np.abs(turn) > least_turn_rad
        if not wall.closed:
            sharp[[0, -1]] = False
        found.append(points[sharp])
    return np.concatenate(found)
