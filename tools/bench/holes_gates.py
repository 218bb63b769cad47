"""True openings of a map: two ends of walls that look at each other across water, and a way through between them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from skimage.draw import line as line_cells

from fill.segments import End, find_walls
from mapping.values import FREE, OCCUPIED

_NARROWEST: Final = 5.0
_WIDEST: Final = 40.0
_FACING: Final = 0.75  # cosine
_ROOM: Final = 3.0  # cells about an opening that belong to its passage
_FREE: Final = 0.9  # of the line between the jambs


@dataclass(frozen=True, slots=True)
class Gate:
    """An opening ``gap`` cells wide about ``row``, ``col``; ``line`` and ``banks`` as in ``Loss``."""

    row: float
    col: float
    gap: float
    line: NDArray[np.int64]
    banks: NDArray[np.int64]


def find_gates(truth: NDArray[np.uint8]) -> list[Gate]:
    """Find openings of 5 to 40 cells whose water was seen and which lead from one side to the other."""
    ends = find_walls(truth == OCCUPIED).ends
    found = []
    for index, a in enumerate(ends):
        for b in ends[index + 1 :]:
            gap = math.hypot(b.x - a.x, b.y - a.y)
            if _NARROWEST <= gap <= _WIDEST and _face(a, b, gap) and (gate := _gate(a, b, gap, truth)) is not None:
                found.append(gate)
    return found


def shut(banks: NDArray[np.int64], solid: NDArray[np.bool_]) -> bool:
    """Whether no way is left between the two sides of a passage."""
    low = banks[:, :2].min(axis=0)
    side = np.full(tuple(banks[:, :2].max(axis=0) - low + 1), -1, np.int64)
    rows, cols = (banks[:, :2] - low).T
    side[rows, cols] = np.where(solid[banks[:, 0], banks[:, 1]], -1, banks[:, 2])
    parts, _ = ndimage.label(side >= 0)
    return not np.intersect1d(parts[side == 1], parts[side == 2]).size


def _face(a: End, b: End, gap: float) -> bool:
    along_x, along_y = (b.x - a.x) / gap, (b.y - a.y) / gap
    return min(a.dx * along_x + a.dy * along_y, -b.dx * along_x - b.dy * along_y) >= _FACING


def _gate(a: End, b: End, gap: float, truth: NDArray[np.uint8]) -> Gate | None:
    share = np.linspace(0.15, 0.85, int(2 * gap))
    row = np.clip(np.rint(a.y + share * (b.y - a.y)), 0, truth.shape[0] - 1).astype(np.int64)
    col = np.clip(np.rint(a.x + share * (b.x - a.x)), 0, truth.shape[1] - 1).astype(np.int64)
    if np.mean(truth[row, col] == FREE) < _FREE:
        return None
    middle = (a.y + b.y) / 2, (a.x + b.x) / 2
    banks = _banks(middle, a, b, gap, truth)
    solid = truth != FREE
    if not all(np.any((banks[:, 2] == side) & ~solid[banks[:, 0], banks[:, 1]]) for side in (1, 2)):
        return None
    if shut(banks, solid):
        return None
    cells = line_cells(int(row[0]), int(col[0]), int(row[-1]), int(col[-1]))  # type: ignore[no-untyped-call]
    return Gate(*middle, gap, np.stack(cells, axis=1).astype(np.int64), banks)


def _banks(middle: tuple[float, float], a: End, b: End, gap: float, truth: NDArray[np.uint8]) -> NDArray[np.int64]:
    rows, cols = np.meshgrid(np.arange(truth.shape[0]), np.arange(truth.shape[1]), indexing="ij")
    down, right = rows - middle[0], cols - middle[1]
    inside = np.hypot(down, right) <= gap / 2 + _ROOM
    across = (down * (b.x - a.x) - right * (b.y - a.y)) / gap
    edge = gap / 4 + 1.0
    side = np.where(truth != FREE, 0, np.where(across > edge, 1, np.where(across < -edge, 2, 0)))
    return np.stack([rows[inside], cols[inside], side[inside]], axis=1)
