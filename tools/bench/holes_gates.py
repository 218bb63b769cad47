"""True openings of a map: two ends of walls that look at each other across water, and a way through between them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from skimage.draw import line as line_cells

from mapping.values import FREE
from tools.bench.holes_walk import tips

_NARROWEST: Final = 5.0
_WIDEST: Final = 40.0
_FACING: Final = 0.75  # cosine
_ROOM: Final = 3.0  # cells about an opening that belong to its passage
_BEHIND: Final = 8  # cells of wall behind an end that tell its direction
_FREE: Final = 0.9  # of the line between the jambs


@dataclass(frozen=True, slots=True)
class Gate:
    """An opening ``gap`` cells wide about ``row``, ``col``; ``line`` and ``banks`` as in ``Loss``."""

    row: float
    col: float
    gap: float
    line: NDArray[np.int64]
    banks: NDArray[np.int64]


def find_gates(truth: NDArray[np.uint8], centre: NDArray[np.bool_]) -> list[Gate]:
    """Find openings of 5 to 40 cells between ends of ``centre`` lines, whose water was seen and leads through."""
    ends = tips(centre, _BEHIND)
    found = []
    for index, a in enumerate(ends):
        for b in ends[index + 1 :]:
            gap = math.hypot(*(b[:2] - a[:2]))
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


def _face(a: NDArray[np.float64], b: NDArray[np.float64], gap: float) -> bool:
    along = (b[:2] - a[:2]) / gap
    return bool(min(a[2:] @ along, -b[2:] @ along) >= _FACING)


def _gate(a: NDArray[np.float64], b: NDArray[np.float64], gap: float, truth: NDArray[np.uint8]) -> Gate | None:
    share = np.linspace(0.15, 0.85, int(2 * gap))
    row, col = np.rint(a[:2, None] + share * (b[:2] - a[:2])[:, None]).astype(np.int64)
    if np.mean(truth[row, col] == FREE) < _FREE:
        return None
    banks = _banks(a, b, gap, truth)
    solid = truth != FREE
    if not all(np.any((banks[:, 2] == side) & ~solid[banks[:, 0], banks[:, 1]]) for side in (1, 2)):
        return None
    if shut(banks, solid):
        return None
    cells = np.stack(line_cells(row[0], col[0], row[-1], col[-1]), axis=1)  # type: ignore[no-untyped-call]
    middle = (a[:2] + b[:2]) / 2
    free = cells[truth[cells[:, 0], cells[:, 1]] == FREE].astype(np.int64)
    return Gate(float(middle[0]), float(middle[1]), gap, free, banks)


def _banks(a: NDArray[np.float64], b: NDArray[np.float64], gap: float, truth: NDArray[np.uint8]) -> NDArray[np.int64]:
    """Cells of the passage about an opening, and on which side of it each lies."""
    rows, cols = np.meshgrid(np.arange(truth.shape[0]), np.arange(truth.shape[1]), indexing="ij")
    down, right = rows - (a[0] + b[0]) / 2, cols - (a[1] + b[1]) / 2
    inside = np.hypot(down, right) <= gap / 2 + _ROOM
    across = (down * (b[1] - a[1]) - right * (b[0] - a[0])) / gap
    edge = gap / 4 + 1.0
    side = np.where(truth != FREE, 0, np.where(across > edge, 1, np.where(across < -edge, 2, 0)))
    return np.stack([rows[inside], cols[inside], side[inside]], axis=1)
