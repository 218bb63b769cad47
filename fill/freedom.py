"""Open water stays open: what a fill may cross, and what was seen on its two sides.

The paper fills any cell below its threshold and so walls up doors and side tunnels; here a cell seen FREE is never
crossed, nor slipped through between two free cells that touch at a corner.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fill.segments import End, cell_at
from mapping.values import FREE, UNKNOWN


def at(state: NDArray[np.uint8], x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.uint8]:
    """State of the cells at places in cells, UNKNOWN outside the grid."""
    row, col = cell_at(y), cell_at(x)
    inside = (row >= 0) & (row < state.shape[0]) & (col >= 0) & (col < state.shape[1])
    found = np.full(row.shape, UNKNOWN, np.uint8)
    found[inside] = state[row[inside], col[inside]]
    return found


def clear_path(cells: NDArray[np.int32], state: NDArray[np.uint8]) -> NDArray[np.int32] | None:
    """Join ``cells`` ``(n, 2)`` edge to edge, so that nothing leaks between; None where free water is in the way.

    Where two cells touch at a corner only, that one of the two between them joins them which was not seen free.
    """
    rows, cols = state.shape
    if cells.min() < 0 or cells[:, 0].max() >= rows or cells[:, 1].max() >= cols:
        return None
    if np.any(state[cells[:, 0], cells[:, 1]] == FREE):
        return None
    moved = cells[1:] != cells[:-1]
    slant = np.flatnonzero(moved[:, 0] & moved[:, 1])
    if not len(slant):
        return cells
    (row, col), (next_row, next_col) = cells[slant].T, cells[slant + 1].T
    shut = state[row, next_col] == FREE
    joint_row, joint_col = np.where(shut, next_row, row), np.where(shut, col, next_col)
    if np.any(state[joint_row, joint_col] == FREE):
        return None
    joints = slant + 1 + np.arange(len(slant))
    path = np.empty((len(cells) + len(slant), 2), np.int32)
    given = np.ones(len(path), np.bool_)
    given[joints] = False
    path[given], path[joints, 0], path[joints, 1] = cells, joint_row, joint_col
    return path


_FAN: Final = np.array(
    [(ahead, aside) for ahead in (0.0, 1.0, 2.0, 3.0) for aside in (-3.0, -2.0, -1.0, 0.0, 1.0, 2.0, 3.0)
     if 0.5 < math.hypot(ahead, aside) <= 3.2]
).T  # fmt: skip


def faces(ends: Sequence[End], state: NDArray[np.uint8]) -> NDArray[np.float64]:
    """Share ``(n,)`` of free water close before and beside the face of each end."""
    return np.asarray(np.mean(_before(ends, state) == FREE, axis=1), np.float64)


def capped(ends: Sequence[End], state: NDArray[np.uint8]) -> NDArray[np.bool_]:
    """Whether each wall ``(n,)`` was seen to end: nothing unknown lies close before its end face."""
    return np.asarray(np.all(_before(ends, state) != UNKNOWN, axis=1), np.bool_)


def _before(ends: Sequence[End], state: NDArray[np.uint8]) -> NDArray[np.uint8]:
    x, y, dx, dy = np.array([(end.x, end.y, end.dx, end.dy) for end in ends]).reshape(-1, 4, 1).transpose(1, 0, 2)
    return at(state, x + _FAN[0] * dx - _FAN[1] * dy, y + _FAN[0] * dy + _FAN[1] * dx)
