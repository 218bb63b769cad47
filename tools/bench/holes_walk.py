"""Centre lines of walls, and walking along them.

Nothing here is shared with the program's own search for walls: what is lost must not change with what is measured.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from skimage.morphology import skeletonize

Cell = tuple[int, int]

_WALL: Final = 12  # cells of centre line that make a wall; less is clutter
_STUB: Final = 6  # cells of wall that stay at either end of a hole
_BRANCH: Final = 0.2  # how often a walk takes a branch
_STEPS: Final = tuple((down, right) for down in (-1, 0, 1) for right in (-1, 0, 1) if down or right)


def centre_lines(wall: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Centre lines of walls, clutter left out."""
    lines = np.asarray(skeletonize(wall), np.bool_)  # type: ignore[no-untyped-call]
    parts, count = ndimage.label(lines, np.ones((3, 3), np.int8))
    return np.asarray(lines & (np.bincount(parts.ravel(), minlength=count + 1)[parts] >= _WALL), np.bool_)


def tips(centre: NDArray[np.bool_], behind: int) -> NDArray[np.float64]:
    """Free ends of centre lines ``(n, 4)``: row, column, and the unit direction (down, right) out of the wall.

    The direction is that from the cell ``behind`` steps back; lines that end or branch before are left out.
    """
    around = ndimage.correlate(centre.astype(np.int8), np.ones((3, 3), np.int8), mode="constant")
    found = []
    for row, col in np.argwhere(centre & (around == 2)).tolist():
        path = [(row, col)]
        seen = {path[0]}
        while len(path) <= behind and (ahead := _next(path[-1], centre, seen)):
            seen.update(ahead)
            path.append(ahead[0])
        if len(path) > behind:
            out = np.subtract(path[0], path[-1])
            found.append([row, col, *(out / np.hypot(*out))])
    return np.array(found).reshape(-1, 4)


def walk_both_ways(
    start: Cell, centre: NDArray[np.bool_], length: int, random: np.random.Generator
) -> list[Cell] | None:
    """Cells of a centre line about ``start``; None where too little of the wall would be left at either end."""
    ahead = _next(start, centre, {start})
    if len(ahead) < 2:
        return None
    first = ahead[0]
    other = max(ahead, key=lambda cell: abs(cell[0] - first[0]) + abs(cell[1] - first[1]))
    seen = {start, *ahead}
    half = length // 2
    arms = [_walk(arm, centre, seen, half + _STUB, random) for arm in (first, other)]
    if min(len(arm) for arm in arms) < half + _STUB:
        return None
    return [*reversed(arms[0][:half]), start, *arms[1][: max(length - half - 1, 0)]]


def _walk(
    start: Cell, centre: NDArray[np.bool_], seen: set[Cell], limit: int, random: np.random.Generator
) -> list[Cell]:
    path = [start]
    while len(path) < limit:
        ahead = _next(path[-1], centre, seen)
        if not ahead:
            break
        seen.update(ahead)
        path.append(ahead[-1 if random.random() < _BRANCH else 0])
    return path


def _next(at: Cell, centre: NDArray[np.bool_], seen: set[Cell]) -> list[Cell]:
    """Neighbours on the line that were not passed, straight ones first."""
    rows, cols = centre.shape
    near = [(at[0] + down, at[1] + right) for down, right in _STEPS]
    line = [(r, c) for r, c in near if 0 <= r < rows and 0 <= c < cols and centre[r, c] and (r, c) not in seen]
    return sorted(line, key=lambda cell: abs(cell[0] - at[0]) + abs(cell[1] - at[1]))
