"""Exams: a hole knocked into one of the site's own walls, or the water of one of its own openings blanked.

The paper (section 3.1.1) knocks out the middles of the best walls and tells its filler where they are.  Here nobody is
told: what is left goes through the whole pipeline, and what comes back is compared with what had stood there.

Where exams are held hangs on the numbers of the cells alone, and each is held in a window of its own: a change of the
map touches only the exams in whose windows it lies, and the others need not be held again.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.spatial import cKDTree

from fill.centre import STEPS
from fill.freedom import at
from fill.segments import EIGHT, End, Walls, find_walls
from mapping.values import FREE, OCCUPIED, UNKNOWN

SIZES: Final = (4, 7, 12, 20, 30)
"""Cells of wall that are knocked out."""
EXAMS: Final = 12
_ABOUT: Final = 26  # cells of the map about a hole that are looked at
_STUB: Final = 6  # cells of wall that stay on either side of a hole
_TRIED: Final = 60  # cells of wall looked at for places
_APART: Final = 24  # cells between two exams
_OPENINGS: Final = 4  # one exam in so many is of an opening, where there is one
_NARROWEST: Final = 4.0  # cells: less is no opening
_FACING: Final = 0.8  # cosine: ends that look at each other across open water

Cell = tuple[int, int]


@dataclass(frozen=True, slots=True)
class Place:
    """Where an exam is held: the first cell of its window, the hole's middle within that, its size, and a number."""

    row: int
    col: int
    middle: Cell
    size: int
    number: int


@dataclass(frozen=True, slots=True)
class Exam:
    """A window with a piece taken out.

    ``state`` is what the filler will see, ``zone`` the cells about the piece; ``opening`` whether it is the water of a
    true opening, not wall, that was taken; ``gone`` the cells taken, with a margin of two.
    """

    state: NDArray[np.uint8]
    zone: NDArray[np.bool_]
    gone: NDArray[np.bool_]
    opening: bool


def places(centre: NDArray[np.bool_], corner: Cell) -> list[Place]:
    """Choose places on centre lines ``(rows, cols)``; ``corner`` is the grid's first cell, numbered in the map."""
    cells = np.argwhere(centre)
    numbers = _mixed(cells + corner)
    order = np.argsort(numbers, kind="stable")[:_TRIED]
    tried = cells[order]
    apart = np.abs(tried[:, None] - tried).max(axis=2, initial=0) >= _APART
    taken: list[int] = []
    found = []
    for index, ((row, col), number) in enumerate(zip(tried.tolist(), numbers[order].tolist(), strict=True)):
        if apart[index, taken].all():
            taken.append(index)
            size = SIZES[number % len(SIZES)]
            first = max(row - size // 2 - _ABOUT, 0), max(col - size // 2 - _ABOUT, 0)
            found.append(Place(*first, (row - first[0], col - first[1]), size, number))
    return found[:EXAMS]


def window(place: Place, state: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Cut the window of an exam out of the map."""
    reach = place.size // 2 + _ABOUT + 1
    return state[place.row : place.row + place.middle[0] + reach, place.col : place.col + place.middle[1] + reach]


def knock_out(state: NDArray[np.uint8], place: Place) -> Exam | None:
    """Take a piece out of the wall in a window ``state``, or the water out of an opening; None where neither is."""
    random = np.random.default_rng(place.number)
    opening = place.number // len(SIZES) % _OPENINGS == 0
    walls = find_walls(state == OCCUPIED, ended=opening)
    if opening and (gates := _openings(walls, state)):
        return _blank_opening(*gates[int(random.integers(len(gates)))], state, random)
    path = _piece(place.middle, walls.centre, place.size)
    return None if path is None else _erase(path, walls, state, random)


def _mixed(cells: NDArray[np.int64]) -> NDArray[np.int64]:
    """Scramble the numbers of cells ``(n, 2)`` into one ``(n,)`` each, of 31 bits (constants of splitmix64)."""
    value = cells[:, 0].astype(np.uint64) * np.uint64(0x9E3779B97F4A7C15) + cells[:, 1].astype(np.uint64)
    for shift, factor in ((30, 0xBF58476D1CE4E5B9), (27, 0x94D049BB133111EB)):
        value = (value ^ (value >> np.uint64(shift))) * np.uint64(factor)
    return np.asarray(value >> np.uint64(33), np.int64)


def _widened(mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    return np.asarray(ndimage.binary_dilation(mask, EIGHT, iterations=2), np.bool_)


def _piece(start: Cell, centre: NDArray[np.bool_], length: int) -> list[Cell] | None:
    """Cells of a centre line about ``start``, with enough of the wall left on both sides; None where there is not."""
    ahead = _next(start, centre, {start})
    if len(ahead) < 2:
        return None
    back = max(ahead[1:], key=lambda cell: abs(cell[0] - ahead[0][0]) + abs(cell[1] - ahead[0][1]))
    seen = {start, *ahead}
    half = length // 2
    arms = [_walk(first, centre, seen, half + _STUB) for first in (ahead[0], back)]
    if min(len(arm) for arm in arms) < half + _STUB:
        return None
    return [*reversed(arms[0][:half]), start, *arms[1][: length - half - 1]]


def _walk(start: Cell, centre: NDArray[np.bool_], seen: set[Cell], limit: int) -> list[Cell]:
    path = [start]
    while len(path) < limit:
        ahead = _next(path[-1], centre, seen)
        if not ahead:
            break
        seen.update(ahead)
        path.append(ahead[0])
    return path


def _next(at: Cell, centre: NDArray[np.bool_], seen: set[Cell]) -> list[Cell]:
    """Neighbours on the centre line that were not passed, straight ones first."""
    rows, cols = centre.shape
    near = [(at[0] + dr, at[1] + dc) for dr, dc in STEPS]
    line = [(r, c) for r, c in near if 0 <= r < rows and 0 <= c < cols and centre[r, c] and (r, c) not in seen]
    return sorted(line, key=lambda cell: abs(cell[0] - at[0]) + abs(cell[1] - at[1]))


def _erase(path: list[Cell], walls: Walls, state: NDArray[np.uint8], random: np.random.Generator) -> Exam:
    """Forget the wall about ``path``, and as a sonar would that missed it, some of the water before it."""
    bare = np.ones(state.shape, bool)
    bare[tuple(np.array(path).T)] = False
    kept = walls.centre & bare
    to_gone = ndimage.distance_transform_edt(bare)
    to_kept = ndimage.distance_transform_edt(~kept) if kept.any() else np.full(bare.shape, np.inf)
    thick = float(walls.half[~bare].max())
    wall = walls.mask & (to_gone <= to_kept) & (to_gone <= thick + 1.5)
    halo = (0.0, random.uniform(1.0, 5.0), len(path) / 2 + 1.0)[int(random.integers(3))]
    seen = np.where(wall | ((to_gone <= halo) & (state == FREE)), UNKNOWN, state).astype(np.uint8)
    return Exam(seen, to_gone <= max(4.0, len(path) / 2), _widened(wall), False)


def _openings(walls: Walls, state: NDArray[np.uint8]) -> list[tuple[End, End]]:
    """Pairs of wall ends that look at each other across water seen free: true openings."""
    ends = walls.ends
    found = []
    for first, second in _facing_pairs(ends, float(max(SIZES))):
        a, b = ends[first], ends[second]
        gap = math.hypot(b.x - a.x, b.y - a.y)
        if gap >= _NARROWEST and _open_between(a, b, gap, state):
            found.append((a, b))
    return found


def _facing_pairs(ends: tuple[End, ...], longest: float) -> list[tuple[int, int]]:
    """Pairs of ends, by their indices, that look straight at each other over up to ``longest`` cells."""
    if len(ends) < 2:
        return []
    places = np.array([(end.x, end.y) for end in ends])
    aims = np.array([(end.dx, end.dy) for end in ends])
    pairs = np.sort(cKDTree(places).query_pairs(longest, output_type="ndarray"), axis=1)
    a, b = pairs[np.lexsort((pairs[:, 1], pairs[:, 0]))].T
    apart = places[b] - places[a]
    gap = np.maximum(np.hypot(apart[:, 0], apart[:, 1]), 1e-9)
    facing = np.minimum(np.sum(apart * aims[a], axis=1), -np.sum(apart * aims[b], axis=1)) / gap > _FACING
    return list(zip(a[facing].tolist(), b[facing].tolist(), strict=True))


def _open_between(a: End, b: End, gap: float, state: NDArray[np.uint8]) -> bool:
    share = np.linspace(0.2, 0.8, int(2 * gap) + 2)
    between = at(state, a.x + (b.x - a.x) * share, a.y + (b.y - a.y) * share)
    return bool(np.mean(between == FREE) > 0.8)


def _blank_opening(a: End, b: End, state: NDArray[np.uint8], random: np.random.Generator) -> Exam:
    rows, cols = np.ogrid[: state.shape[0], : state.shape[1]]
    radius = math.hypot(b.x - a.x, b.y - a.y) / 2 * random.uniform(0.7, 1.1) + 1.0
    disc = (rows - (a.y + b.y) / 2) ** 2 + (cols - (a.x + b.x) / 2) ** 2 <= radius**2
    water = disc & (state == FREE)
    return Exam(np.where(water, UNKNOWN, state).astype(np.uint8), disc, _widened(water), True)


def near_wall(state: NDArray[np.uint8]) -> NDArray[np.bool_]:
    """Cells ``(rows, cols)`` that are wall or touch wall: a fill there is right."""
    near: NDArray[np.bool_] = ndimage.binary_dilation(state == OCCUPIED, EIGHT)
    return near
