"""Lessons from the site itself: holes knocked into its own walls, and water blanked in its own openings.

The paper (section 3.1.1) knocks out the middles of the best walls and tells its filler where they are.  Here nobody
is told: a knocked-out grid goes through the whole pipeline, and what comes back is compared with what had stood there.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.spatial import cKDTree

from fill.freedom import at
from fill.segments import EIGHT, STEPS, End, Walls
from mapping.values import FREE, OCCUPIED, UNKNOWN

_SHORTEST: Final = 3.0
_STUB: Final = 6  # cells of wall that stay on either side of a hole
_APART: Final = 10  # cells between two lessons on one grid
_TRIES: Final = 12  # starts looked at for each hole wanted
_NARROWEST: Final = 4.0  # cells: less is no opening
_FACING: Final = 0.8  # cosine: ends that look at each other across open water

Cell = tuple[int, int]


@dataclass(frozen=True, slots=True)
class Exam:
    """A grid with ``holes`` pieces taken out.

    ``state`` is what the filler will see, ``zone`` the cells about the pieces, ``wall`` the wall taken out and
    ``water`` the water of true openings, each with a margin of two cells.
    """

    state: NDArray[np.uint8]
    zone: NDArray[np.bool_]
    wall: NDArray[np.bool_]
    water: NDArray[np.bool_]
    holes: int


def knock_out(state: NDArray[np.uint8], walls: Walls, longest: float, count: int, random: np.random.Generator) -> Exam:
    """Take up to ``count`` pieces out of the walls, and the water out of up to a quarter as many openings."""
    seen = state.copy()
    zone = np.zeros(state.shape, bool)
    for first, second in _openings(walls, state, longest, count // 4, random):
        _blank_opening(first, second, seen, zone, state, random)
    water = _widened(seen != state)
    holes = 0
    starts = np.argwhere(walls.centre)
    for _ in range(_TRIES * count):
        if holes == count or not len(starts):
            break
        length = math.exp(random.uniform(math.log(_SHORTEST), math.log(longest)))
        start = starts[random.integers(len(starts))]
        path = _piece((int(start[0]), int(start[1])), walls.centre, round(length))
        if path is not None and not _near(path, zone):
            _erase(path, walls, seen, zone, random)
            holes += 1
    return Exam(seen, zone, _widened((state == OCCUPIED) & (seen == UNKNOWN)), water, holes)


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


def _near(path: list[Cell], zone: NDArray[np.bool_]) -> bool:
    rows, cols = np.array(path).T
    low = max(int(rows.min()) - _APART, 0), max(int(cols.min()) - _APART, 0)
    return bool(zone[low[0] : int(rows.max()) + _APART + 1, low[1] : int(cols.max()) + _APART + 1].any())


def _erase(
    path: list[Cell], walls: Walls, seen: NDArray[np.uint8], zone: NDArray[np.bool_], random: np.random.Generator
) -> None:
    """Forget the wall about ``path``, and as a sonar would that missed it, some of the water before it."""
    cells = np.array(path)
    margin = _STUB + int(len(path) / 2) + 4
    low = np.maximum(cells.min(axis=0) - margin, 0)
    high = cells.max(axis=0) + margin + 1
    window = slice(low[0], high[0]), slice(low[1], high[1])
    gone = np.ones(seen[window].shape, bool)
    gone[tuple((cells - low).T)] = False
    kept = walls.centre[window] & gone
    to_gone = ndimage.distance_transform_edt(gone)
    to_kept = ndimage.distance_transform_edt(~kept) if kept.any() else np.full(gone.shape, np.inf)
    thick = float(walls.half[window][~gone].max())
    wall = walls.mask[window] & (to_gone <= to_kept) & (to_gone <= thick + 1.5)
    halo = (0.0, random.uniform(1.0, 5.0), len(path) / 2 + 1.0)[int(random.integers(3))]
    water = (to_gone <= halo) & (seen[window] == FREE)
    seen[window][wall | water] = UNKNOWN
    zone[window] |= to_gone <= max(4.0, len(path) / 2)


def _openings(
    walls: Walls, state: NDArray[np.uint8], longest: float, count: int, random: np.random.Generator
) -> list[tuple[End, End]]:
    """Pairs of wall ends that look at each other across water seen free: true openings."""
    ends = walls.ends
    found = []
    for first, second in _facing_pairs(ends, longest):
        a, b = ends[first], ends[second]
        gap = math.hypot(b.x - a.x, b.y - a.y)
        if gap >= _NARROWEST and _open_between(a, b, gap, state):
            found.append((a, b))
    chosen = random.permutation(len(found))[:count]
    return [found[int(index)] for index in chosen]


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


def _blank_opening(
    a: End, b: End, seen: NDArray[np.uint8], zone: NDArray[np.bool_], state: NDArray[np.uint8],
    random: np.random.Generator,
) -> None:  # fmt: skip
    rows, cols = np.ogrid[: state.shape[0], : state.shape[1]]
    radius = math.hypot(b.x - a.x, b.y - a.y) / 2 * random.uniform(0.7, 1.1) + 1.0
    disc = (rows - (a.y + b.y) / 2) ** 2 + (cols - (a.x + b.x) / 2) ** 2 <= radius**2
    if (disc & zone).any():
        return
    seen[disc & (state == FREE)] = UNKNOWN
    zone |= disc


def near_wall(state: NDArray[np.uint8]) -> NDArray[np.bool_]:
    """Cells ``(rows, cols)`` that are wall or touch wall: a fill there is right."""
    near: NDArray[np.bool_] = ndimage.binary_dilation(state == OCCUPIED, EIGHT)
    return near
