"""Open water stays open: what a fill may cross, and what was seen on its two sides.

The paper fills any cell below its threshold and so walls up doors and side tunnels; here a cell seen FREE is never
crossed, nor slipped through between two free cells that touch at a corner.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from fill.segments import End
from mapping.values import FREE, UNKNOWN

_NEAR: Final = 2.0  # cells from the wall's face where the sides are looked at, to
_FAR: Final = 7.0


def at(state: NDArray[np.uint8], x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.uint8]:
    """State of the cells at places in cells, UNKNOWN outside the grid."""
    row, col = np.rint(y).astype(np.int64), np.rint(x).astype(np.int64)
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
    slant = np.flatnonzero(np.all(cells[1:] != cells[:-1], axis=1))
    if not len(slant):
        return cells
    first = np.stack([cells[slant, 0], cells[slant + 1, 1]], axis=1)
    other = np.stack([cells[slant + 1, 0], cells[slant, 1]], axis=1)
    shut = state[first[:, 0], first[:, 1]] == FREE
    joint = np.where(shut[:, None], other, first)
    if np.any(state[joint[:, 0], joint[:, 1]] == FREE):
        return None
    return np.insert(cells, slant + 1, joint, axis=0)


def sides(
    points: NDArray[np.float64], half: float, state: NDArray[np.uint8]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Share of free water on the left and on the right of each tenth of a curve, two to seven cells off its face."""
    pick = points[np.linspace(0, len(points) - 1, 10).astype(np.int64)]
    ahead = np.gradient(pick, axis=0)
    ahead /= np.maximum(np.hypot(ahead[:, 0], ahead[:, 1]), 1e-9)[:, None]
    off = np.arange(_NEAR, _FAR + 1.0) + half - 0.5
    shares = []
    for sign in (1.0, -1.0):
        x = pick[:, 0, None] - sign * ahead[:, 1, None] * off
        y = pick[:, 1, None] + sign * ahead[:, 0, None] * off
        shares.append(np.mean(at(state, x, y) == FREE, axis=1))
    return shares[0], shares[1]


def capped(end: End, state: NDArray[np.uint8]) -> bool:
    """Whether the wall was seen to end: free water across the whole of its end face."""
    across = np.arange(-end.half, end.half + 0.6, 0.5)
    for ahead in (1.0, 1.8):
        x = end.x + end.dx * ahead - end.dy * across
        y = end.y + end.dy * ahead + end.dx * across
        if np.all(at(state, x, y) == FREE):
            return True
    return False
