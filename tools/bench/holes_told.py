"""Our curves where the ends of a hole are told, as the paper tells them to its fits when it learns."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from fill.candidates import Candidate
from fill.closing import fill_cells, open_walls
from fill.matching import candidates
from fill.memory import Memory
from fill.prior import prior
from fill.segments import End
from fill.settling import settled
from mapping.values import OCCUPIED

_REACH: Final = 20.0  # cells: no knocked-out piece is as long
_AT: Final = 3.0  # cells from what was knocked out to the ends that are told
_AWAY: Final = 8.0  # cells: a way that leaves the hole further is not of this hole
_EIGHT: Final = np.ones((3, 3), np.int8)


def fill_told(seen: NDArray[np.uint8], gone: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Fill each piece ``gone`` ``(rows, cols)`` by the likeliest way between its own two ends; the cells filled."""
    filled = np.zeros(seen.shape, bool)
    memory = Memory()
    wall = seen == OCCUPIED
    found = [each for each in candidates(open_walls(wall, seen, memory), seen, _REACH, memory) if not each.side]
    if not found:
        return filled
    chances = prior().hole.chance(np.stack([each.features for each in found]))
    pieces, count = ndimage.label(gone, _EIGHT)
    for number in range(1, count + 1):
        away = ndimage.distance_transform_edt(pieces != number)
        own = [index for index, each in enumerate(found) if _belongs(each, away)]
        if own:
            best = found[max(own, key=lambda index: chances[index])]
            for cells in fill_cells(settled(best, seen, memory), seen, wall):
                filled[cells[:, 0], cells[:, 1]] = True
    return filled


def _belongs(candidate: Candidate, away: NDArray[np.float64]) -> bool:
    rows, cols = candidate.path.T
    return bool(away[rows, cols].max() <= _AWAY and all(_at(end, away) <= _AT for end in candidate.ends))


def _at(end: End, away: NDArray[np.float64]) -> float:
    row, col = np.clip(np.rint([end.y, end.x]).astype(np.int64), 0, np.array(away.shape) - 1)
    return float(away[row, col])
