"""One way to close one hole: its path, and what tells whether it is right."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fill.curves import Chord, Curve, bowed, cells_of, chord, curves, straight
from fill.freedom import clear_path, sides
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
    "both free",
    "one free",
    "corner",
    "side",
    "specks",
    "divides",
    "both free far",
    "detour",
)
"""What a candidate is judged by, in this order."""

_BOWS: Final = (0.0, 1.0, -1.0, 2.0, -2.0, 3.0, -3.0)
_THROUGH: Final = 2  # cells of another wall on a path that are still taken for specks


@dataclass(frozen=True, slots=True)
class Candidate:
    """A way to close a hole between ends ``first`` and ``second`` (-1: the side of a wall).

    ``path`` ``(n, 2)`` int32 of row and column, joined edge to edge from inside the one wall to inside the other;
    ``cells`` the same as a set, ``box`` their lowest and highest row and column; ``features`` after ``FEATURES``;
    ``half_a``, ``half_b`` half the thickness at either end; ``start`` and ``finish`` x and y of both ends, in cells.
    """

    first: int
    second: int
    curve: str
    path: NDArray[np.int32]
    cells: frozenset[tuple[int, int]]
    box: NDArray[np.int32]
    gap: float
    features: NDArray[np.float64]
    half_a: float
    half_b: float
    start: tuple[float, float]
    finish: tuple[float, float]


def across(first: int, second: int, walls: Walls, state: NDArray[np.uint8]) -> Candidate | None:
    """Join two ends by the likeliest curve that crosses no free water; None where there is none."""
    a, b = walls.ends[first], walls.ends[second]
    between = chord(a, b)
    for curve in curves(a, b, between):
        room = 0.25 * between.gap + 1.0
        for height in _BOWS:
            if abs(height) > room:
                continue
            drawn = bowed(curve, height)
            path = _path(drawn, walls, state, {a.wall, b.wall})
            if path is not None:
                features = _features(a, b, between, drawn, state, path)
                return _candidate((first, second), drawn, path, between.gap, features, (a, b))
    return None


def onto_side(index: int, walls: Walls, state: NDArray[np.uint8], longest: float) -> Candidate | None:
    """Let a wall go straight on until it meets the side of another; None where open water lies before that."""
    a = walls.ends[index]
    hit = _meets(a, walls, state, longest)
    if hit is None:
        return None
    x, y = a.x + a.dx * hit, a.y + a.dy * hit
    half = float(walls.half[round(y), round(x)])
    b = End(x, y, -a.dx, -a.dy, min(half, a.half), a.line, a.length, a.wander, int(walls.label[round(y), round(x)]))
    curve = straight(a.x, a.y, x, y, "side")
    path = _path(curve, walls, state, {a.wall, b.wall})
    if path is None:
        return None
    features = _features(a, b, Chord(hit, 0.0, 0.0), curve, state, path)
    return _candidate((index, -1), curve, path, hit, features, (a, b))


def _candidate(
    pair: tuple[int, int], curve: Curve, path: NDArray[np.int32], gap: float, features: NDArray[np.float64],
    ends: tuple[End, End],
) -> Candidate:  # fmt: skip
    cells = frozenset((int(row), int(col)) for row, col in path)
    box = np.concatenate([path.min(axis=0), path.max(axis=0)])
    halves = ends[0].half, ends[1].half
    places = (ends[0].x, ends[0].y), (ends[1].x, ends[1].y)
    return Candidate(*pair, curve.name, path, cells, box, gap, features, *halves, *places)


def _meets(a: End, walls: Walls, state: NDArray[np.uint8], longest: float) -> float | None:
    """How far ahead of an end the next wall is, in cells, with no free water before it."""
    ahead = np.arange(1.0, longest, 0.5)
    row = np.rint(a.y + a.dy * ahead).astype(np.int64)
    col = np.rint(a.x + a.dx * ahead).astype(np.int64)
    inside = (row >= 0) & (row < state.shape[0]) & (col >= 0) & (col < state.shape[1])
    if not inside.all():
        cut = int(np.argmin(inside))
        row, col = row[:cut], col[:cut]
    stop = np.flatnonzero((state[row, col] == FREE) | walls.mask[row, col])
    for place in stop:
        if state[row[place], col[place]] == FREE:
            return None
        if walls.half[row[place], col[place]] > 1.0 or _runs_on(walls.centre, int(row[place]), int(col[place])):
            return float(ahead[place])
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
    left, right = sides(curve.points, (a.half + b.half) / 2, state)
    inner = slice(2, 8)
    both = float(np.minimum(left, right)[inner].mean())
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
            both,
            float(np.abs(left - right)[inner].mean()),
            float(curve.name == "corner"),
            float(curve.name == "side"),
            specks,
            (_divides(a, state) + _divides(b, state)) / 2,
            both * math.log(gap),
            math.log(max(length, 1.0) / gap),
        ]
    )


def _divides(end: End, state: NDArray[np.uint8]) -> float:
    """How much of the wall behind an end has free water on both of its sides."""
    left, right = sides(end.line, end.half, state)
    return float(np.minimum(left, right).mean())
