"""One way to close one hole: its path, and what tells whether it is right."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fill.curves import Chord, Curve, bowed, cells_of, chord, curves, straight
from fill.freedom import at, clear_path, sides
from fill.segments import End, Walls
from mapping.values import FREE, OCCUPIED

FEATURES: Final = (
    "one",
    "log gap",
    "bend",
    "turn",
    "offset",
    "half",
    "log support",
    "wander",
    "near both",
    "near one",
    "water both",
    "water one",
    "divides",
    "water both, divides",
    "snug",
    "corner",
    "side",
    "specks",
    "detour",
)
"""What a candidate is judged by, in this order."""

_TURNS: Final = math.radians(40.0)  # more than that is a corner or an arc, which leaves the chord far behind
_BESIDE: Final = 5.0  # cells
_BOWS: Final = np.array([0.0, 1.0, -1.0, 2.0, -2.0, 3.0, -3.0])  # cells
_WATER_BOTH: Final = FEATURES.index("water both")
_NEAR_BOTH: Final = FEATURES.index("near both")
_WATER_ONE: Final = FEATURES.index("water one")
_DIVIDES: Final = FEATURES.index("divides")
_PASSABLE: Final = 4.0  # cells; narrower gaps are taken for holes
_REACH: Final = 0.6  # of the gap: so far to its sides water is looked for
_GLANCES: Final = np.radians([0.0, 10.0, -10.0])
_THROUGH: Final = 2  # cells of another wall on a path that are still taken for specks


@dataclass(frozen=True, slots=True)
class Candidate:
    """A way to close a hole between ends ``first`` and ``second`` (-1: the side of a wall).

    ``path`` ``(n, 2)`` int32 of row and column, joined edge to edge from inside the one wall to inside the other;
    ``cells`` the same as a set; ``features`` after ``FEATURES``; ``half_a``, ``half_b`` half the thickness at either
    end; ``start`` and ``finish`` x and y of both ends, in cells; ``ends`` the two as they were found, where a wall is
    met on its side the place that is met.
    """

    first: int
    second: int
    curve: str
    path: NDArray[np.int32]
    cells: frozenset[tuple[int, int]]
    gap: float
    features: NDArray[np.float64]
    half_a: float
    half_b: float
    start: tuple[float, float]
    finish: tuple[float, float]
    ends: tuple[End, End]


def across(first: int, second: int, walls: Walls, state: NDArray[np.uint8]) -> Candidate | None:
    """Join two ends by the likeliest curve that crosses no free water; None where there is none."""
    a, b = walls.ends[first], walls.ends[second]
    between = chord(a, b)
    if between.turn < _TURNS and _blocked(a, b, state):
        return None
    heights = _BOWS[np.abs(_BOWS) <= 0.25 * between.gap + 1.0]
    bows = [(rank, curve) for curve in curves(a, b, between) for rank, curve in _clear_bows(curve, heights, state)]
    for _, curve in sorted(bows, key=lambda bow: bow[0]):  # the least bow first, of equal ones the likeliest curve
        path = _path(curve, walls, state, {a.wall, b.wall})
        if path is not None:
            features = _features(a, b, between, curve, state, path)
            return _candidate((first, second), curve, path, between.gap, features, (a, b))
    return None


def _clear_bows(curve: Curve, heights: NDArray[np.float64], state: NDArray[np.uint8]) -> list[tuple[int, Curve]]:
    """Bows of a curve that cross no free cell, each with the rank of its height."""
    points = bowed(curve, heights)
    crosses = np.any(at(state, points[..., 0], points[..., 1]) == FREE, axis=1)
    return [(int(rank), Curve(curve.name, points[rank])) for rank in np.flatnonzero(~crosses)]


def _blocked(a: End, b: End, state: NDArray[np.uint8]) -> bool:
    """Whether free water lies so wide across the chord that no bow passes it by."""
    share = np.linspace(0.2, 0.8, 7)[:, None]
    ahead_x, ahead_y = b.x - a.x, b.y - a.y
    off = np.arange(-_BESIDE, _BESIDE + 1.0) / max(math.hypot(ahead_x, ahead_y), 1e-9)
    seen = at(state, a.x + share * ahead_x - off * ahead_y, a.y + share * ahead_y + off * ahead_x)
    return bool(np.any(np.all(seen == FREE, axis=1)))


def onto_side(index: int, walls: Walls, state: NDArray[np.uint8], longest: float) -> Candidate | None:
    """Let a wall go on until it meets another that has no end there; None where open water lies before that."""
    a = walls.ends[index]
    hit = _meets(a, walls, state, longest)
    if hit is None:
        return None
    x, y = hit
    gap, away = math.hypot(x - a.x, y - a.y), math.atan2(y - a.y, x - a.x) - math.atan2(a.dy, a.dx)
    met = round(y), round(x)
    half = min(float(walls.half[met]) - 0.5, a.half)
    b = End(x, y, -a.dx, -a.dy, half, a.line, a.length, a.wander, int(walls.label[met]))
    curve = straight(a.x, a.y, x, y, "side")
    path = _path(curve, walls, state, {a.wall, b.wall})
    if path is None:
        return None
    features = _features(a, b, Chord(gap, math.remainder(away, math.tau), 0.0), curve, state, path)
    return _candidate((index, -1), curve, path, gap, features, (a, b))


def opening(candidate: Candidate) -> bool:
    """Whether this is a way through rather than a hole: a gap one could pass, with water seen on both sides.

    A wall that divides water along its whole length looks the same where it was missed, but then the water was seen
    to come close to both of its faces.
    """
    seen = candidate.features
    divides = seen[_DIVIDES] > 0.5 and seen[_NEAR_BOTH] > 0.5
    return bool(candidate.gap > _PASSABLE and seen[_WATER_BOTH] > 0.5 and not divides)


def dry(candidate: Candidate) -> bool:
    """Whether hardly any water was seen beside the fill: a wall is where water ends, and elsewhere nobody knows."""
    seen = candidate.features[_WATER_BOTH] + candidate.features[_WATER_ONE]
    return bool(candidate.gap > _PASSABLE and seen < 0.3)


def _candidate(
    pair: tuple[int, int], curve: Curve, path: NDArray[np.int32], gap: float, features: NDArray[np.float64],
    ends: tuple[End, End],
) -> Candidate:  # fmt: skip
    cells = frozenset((int(row), int(col)) for row, col in path)
    halves = ends[0].half, ends[1].half
    places = (ends[0].x, ends[0].y), (ends[1].x, ends[1].y)
    return Candidate(*pair, curve.name, path, cells, gap, features, *halves, *places, ends)


def _meets(a: End, walls: Walls, state: NDArray[np.uint8], longest: float) -> tuple[float, float] | None:
    """Where a wall is met first by looks ahead and a little aside with no free water before it: x and y in cells."""
    along = np.arange(1.0, longest, 0.5)
    turn = math.atan2(a.dy, a.dx) + _GLANCES[:, None]
    x, y = a.x + along * np.cos(turn), a.y + along * np.sin(turn)
    rows, cols = state.shape
    row, col = np.rint(y).astype(np.int64), np.rint(x).astype(np.int64)
    inside = (row >= 0) & (row < rows) & (col >= 0) & (col < cols)
    row, col = np.clip(row, 0, rows - 1), np.clip(col, 0, cols - 1)
    stop = ~inside | (state[row, col] == FREE) | walls.mask[row, col]
    first = np.argmax(stop, axis=1)
    looks = np.arange(len(_GLANCES))
    met = inside[looks, first] & walls.mask[row[looks, first], col[looks, first]]
    price = np.where(met, along[first] * (2.0 - np.cos(_GLANCES)), np.inf)
    for look in np.argsort(price, kind="stable"):
        place = look, first[look]
        if not met[look]:
            break
        if walls.half[row[place], col[place]] > 1.0 or _runs_on(walls.centre, int(row[place]), int(col[place])):
            return float(x[place]), float(y[place])
    return None


def _runs_on(centre: NDArray[np.bool_], row: int, col: int) -> bool:
    """Whether a wall, and not a speck, stands here: its centre line has some length."""
    near = centre[max(row - 3, 0) : row + 4, max(col - 3, 0) : col + 4]
    return int(np.count_nonzero(near)) >= 5


def _path(curve: Curve, walls: Walls, state: NDArray[np.uint8], own: set[int]) -> NDArray[np.int32] | None:
    path = clear_path(cells_of(curve.points), state)
    if path is None:
        return None
    met = walls.label[path[:, 0], path[:, 1]]
    others = (met > 0) & ~np.isin(met, list(own))
    return None if np.count_nonzero(others) > _THROUGH else path


def _features(
    a: End, b: End, between: Chord, curve: Curve, state: NDArray[np.uint8], path: NDArray[np.int32]
) -> NDArray[np.float64]:
    gap = max(between.gap, 1.0)
    doubt = math.atan(1.0 / gap)  # a cell of stairs turns a short chord by this much
    bend = max(0.0, max(between.bend_a, between.bend_b) - doubt)
    seen = sides(curve.points, (a.half + b.half) / 2, state, _REACH * gap + 4.0)
    near, water = seen.near[:, 2:8], seen.water[:, 2:8]
    both = float(np.mean(water[0] & water[1]))
    divides = (_divides(a, state) + _divides(b, state)) / 2
    length = float(len(curve.points)) * 0.25
    specks = float(np.mean(state[path[:, 0], path[:, 1]] == OCCUPIED))
    return np.array(
        [
            1.0,
            math.log(gap),
            bend,
            max(0.0, between.turn - doubt),
            math.log1p(gap * math.sin(min(bend, math.pi / 2))),
            math.log1p((a.half + b.half) / 2),
            math.log(min(a.length, b.length)),
            max(a.wander, b.wander),
            float(near.min(axis=0).mean()),
            float(np.abs(near[0] - near[1]).mean()),
            both,
            float(np.mean(water[0] ^ water[1])),
            divides,
            both * divides,
            float(np.mean(seen.snug[:, 2:8])),
            float(curve.name == "corner"),
            float(curve.name == "side"),
            specks,
            math.log(max(length, 1.0) / gap),
        ]
    )


def _divides(end: End, state: NDArray[np.uint8]) -> float:
    """How much of the wall behind an end has free water on both of its sides."""
    return float(sides(end.line, end.half, state).near.min(axis=0).mean())
