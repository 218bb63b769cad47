"""Walls as centre lines, and the true ends of these.

An end is where a wall stops being seen.  Rings (pillars, finished rooms) have none, every branch keeps its own, a
thick wall ends in its middle, and blobs that are no longer than they are thick are not walls.  The paper finds ends
by two passes of Dijkstra's algorithm (section 3.2), which invents two ends on every ring and loses those of branches;
skeletons do neither.

Coordinates here are cells: x is the column, y the row, whole numbers at cell centres.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from skimage.morphology import skeletonize

STEPS: Final = ((-1, -1), (-1, 0), (-1, 1), (0, -1), (0, 1), (1, -1), (1, 0), (1, 1))
EIGHT: Final = np.ones((3, 3), np.int8)
SUPPORT: Final = 14
"""How many cells of centre line behind an end tell its direction."""
_SPUR_ROUNDS: Final = 2
_SOLID: Final = 8.0  # cells from the nearest water: deeper is not wall but the ground behind it


@dataclass(frozen=True, slots=True)
class End:
    """A true end of a wall.

    ``x``, ``y`` is the middle of the end face, ``dx``, ``dy`` the unit direction out of the wall; ``half`` half the
    wall's thickness; ``line`` ``(n, 2)`` float64 the centre line behind the end, nearest first; ``length`` the centre
    line's length as far as it was followed; ``wander`` its mean distance from a straight line; ``wall`` the label of
    the connected wall.  All in cells.
    """

    x: float
    y: float
    dx: float
    dy: float
    half: float
    line: NDArray[np.float64]
    length: float
    wander: float
    wall: int


@dataclass(frozen=True, slots=True)
class Walls:
    """Walls of one grid, in layers ``(rows, cols)``, and their ends.

    ``mask`` of wall cells, ``label`` of connected walls (0: none), ``half`` distance of each wall cell from the
    wall's edge, ``centre`` mask of the centre lines.
    """

    mask: NDArray[np.bool_]
    label: NDArray[np.int32]
    half: NDArray[np.float32]
    centre: NDArray[np.bool_]
    ends: tuple[End, ...]


def find_walls(mask: NDArray[np.bool_]) -> Walls:
    """Find the walls in ``mask`` ``(rows, cols)`` and their true ends, in order of row and column."""
    padded = np.pad(mask, 1)
    half = ndimage.distance_transform_edt(padded).astype(np.float32)
    if half.max(initial=0.0) > _SOLID:
        half = np.where(half > _SOLID, 0, half).astype(np.float32)
    wall = half > 0
    label = np.zeros(wall.shape, np.int32)
    ndimage.label(wall, EIGHT, output=label)
    centre = np.asarray(skeletonize(wall), np.bool_)  # type: ignore[no-untyped-call]
    _prune(centre, half)
    ends = [_end(at, centre, half, label) for at in _tips(centre)]
    inner = slice(1, -1), slice(1, -1)
    kept = tuple(end for end in ends if end is not None)
    return Walls(wall[inner], label[inner], half[inner], centre[inner], kept)


def _tips(centre: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Cells of the centre lines with one neighbour or none."""
    around = ndimage.convolve(centre.astype(np.int8), EIGHT, mode="constant") - 1
    return [(int(row), int(col)) for row, col in np.argwhere(centre & (around <= 1))]


def _neighbours(at: tuple[int, int], centre: NDArray[np.bool_]) -> list[tuple[int, int]]:
    row, col = at
    return [(row + dr, col + dc) for dr, dc in STEPS if centre[row + dr, col + dc]]


def follow(at: tuple[int, int], centre: NDArray[np.bool_], limit: int) -> tuple[list[tuple[int, int]], bool]:
    """Walk along a centre line from its tip: the cells passed, and whether the walk stopped at a branching."""
    path, seen = [at], {at}
    while len(path) < limit:
        ahead = [cell for cell in _neighbours(path[-1], centre) if cell not in seen]
        if not ahead:
            return path, False
        if len(ahead) > 1 and not _one_way(ahead):
            return path, True
        # Of two cells side by side the straight one comes first, so that the diagonal one is not a branch.
        step = min(ahead, key=lambda cell: abs(cell[0] - path[-1][0]) + abs(cell[1] - path[-1][1]))
        seen.update(ahead)
        path.append(step)
    return path, False


def _one_way(cells: list[tuple[int, int]]) -> bool:
    """Whether all of these neighbours touch each other: a bend of the line, not a branching."""
    first = cells[0]
    return all(max(abs(row - first[0]), abs(col - first[1])) <= 1 for row, col in cells[1:])


def _prune(centre: NDArray[np.bool_], half: NDArray[np.float32]) -> None:
    """Remove spurs, branches that do not leave the thickness of the wall they stand on, from ``centre`` itself."""
    longest = int(half.max(initial=0.0)) + 3
    for _ in range(_SPUR_ROUNDS):
        for at in _tips(centre):
            path, branches = follow(at, centre, longest)
            if branches and len(path) <= float(half[path[-1]]) + 1.0:
                rows, cols = zip(*path, strict=True)
                centre[rows, cols] = False
                centre[path[-1]] = True


def _end(
    at: tuple[int, int], centre: NDArray[np.bool_], half: NDArray[np.float32], label: NDArray[np.int32]
) -> End | None:
    path, _ = follow(at, centre, 2 * SUPPORT)
    cells = np.array(path)
    thick = float(np.median(half[cells[:, 0], cells[:, 1]])) - 0.5
    if len(path) < 3 or len(path) + thick < 2.5 * thick + 2.0:
        return None
    line = smooth(cells[:, ::-1].astype(np.float64) - 1.0)
    middle, out, wander = direction(line[: SUPPORT + 1])
    tip = middle + out * float(np.dot(line[0] - middle, out))
    reach = _to_edge(tip + 1.0, out, half)
    x, y = tip + out * reach
    length = float(np.hypot(*np.diff(line, axis=0).T).sum()) + reach
    return End(float(x), float(y), float(out[0]), float(out[1]), thick, line, length, wander, int(label[at]))


def smooth(line: NDArray[np.float64]) -> NDArray[np.float64]:
    """Take the stairs out of a line of cells ``(n, 2)``: a running mean over three, ends kept."""
    if len(line) < 3:
        return line
    inner = (line[:-2] + line[1:-1] + line[2:]) / 3.0
    return np.concatenate([line[:1], inner, line[-1:]])


def direction(line: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64], float]:
    """Middle, unit direction towards the first point, and mean distance of a line ``(n, 2)`` from straight."""
    weight = np.linspace(1.0, 0.4, len(line))
    middle = np.average(line, axis=0, weights=weight)
    spread = (line - middle) * np.sqrt(weight)[:, None]
    out = np.linalg.svd(spread, full_matrices=False)[2][0]
    if np.dot(line[0] - line[-1], out) < 0:
        out = -out
    normal = np.array([-out[1], out[0]])
    return middle, out, float(np.abs((line - middle) @ normal).mean())


def _to_edge(tip: NDArray[np.float64], out: NDArray[np.float64], half: NDArray[np.float32]) -> float:
    """How far the wall still goes on from the tip of its centre line."""
    steps = 0
    while steps < 2 * _SOLID:
        x, y = tip + out * (0.5 * (steps + 1))
        row, col = round(y), round(x)
        if not (0 <= row < half.shape[0] and 0 <= col < half.shape[1]) or half[row, col] <= 0:
            break
        steps += 1
    return 0.5 * steps
