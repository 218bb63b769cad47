"""Open water stays open: what a fill may cross, and what was seen on its two sides.

The paper fills any cell below its threshold and so walls up doors and side tunnels; here a cell seen FREE is never
crossed, nor slipped through between two free cells that touch at a corner.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fill.segments import End
from mapping.values import FREE, UNKNOWN

_NEAR: Final = 2.0  # cells from the wall's face where the sides are looked at, to
_FAR: Final = 7.0
_DENSE: Final = 4  # cells of water in a row that are water and not a stray ray
_LOOKS: Final = 10  # places along a curve


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


_FAN: Final = np.array(
    [(ahead, aside) for ahead in (0.0, 1.0, 2.0, 3.0) for aside in (-3.0, -2.0, -1.0, 0.0, 1.0, 2.0, 3.0)
     if 0.5 < math.hypot(ahead, aside) <= 3.2]
).T  # fmt: skip


@dataclass(frozen=True, slots=True)
class Sides:
    """What lies on either side of a curve, looked at square to it from ten places along it.

    Left side first: ``near`` ``(2, 10)`` float64 is the share of free water two to seven cells off the wall's face,
    ``snug`` ``(2, 10)`` of that within two cells, ``water`` ``(2, 10)`` bool whether the first thing seen, however far
    within the reach, is free water and no stray ray.
    """

    near: NDArray[np.float64]
    snug: NDArray[np.float64]
    water: NDArray[np.bool_]


def sides(points: NDArray[np.float64], half: float, state: NDArray[np.uint8], reach: float = _FAR) -> Sides:
    """Look to both sides of a curve ``(n, 2)``, up to ``reach`` cells off the face of a wall of ``half`` thickness."""
    pick = points[np.linspace(0, len(points) - 1, _LOOKS).astype(np.int64)]
    ahead = np.gradient(pick, axis=0)
    ahead /= np.maximum(np.hypot(ahead[:, 0], ahead[:, 1]), 1e-9)[:, None]
    off = np.arange(1.0, max(reach, _FAR) + 1.0) + half - 0.5
    lateral = np.array([1.0, -1.0])[:, None, None] * off
    seen = at(state, pick[:, 0, None] - lateral * ahead[:, 1, None], pick[:, 1, None] + lateral * ahead[:, 0, None])
    near = np.mean(seen[:, :, int(_NEAR) - 1 : int(_FAR)] == FREE, axis=2)
    first = np.argmax(seen != UNKNOWN, axis=2)[:, :, None] + np.arange(_DENSE)
    water = np.mean(np.take_along_axis(seen, np.minimum(first, len(off) - 1), axis=2) == FREE, axis=2) > 0.6
    snug = np.mean(seen[:, :, :2] == FREE, axis=2)
    return Sides(np.asarray(near, np.float64), np.asarray(snug, np.float64), np.asarray(water, np.bool_))


def capped(end: End, state: NDArray[np.uint8]) -> bool:
    """Whether the wall was seen to end: nothing unknown lies close before its end face."""
    x, y = end.x + _FAN[0] * end.dx - _FAN[1] * end.dy, end.y + _FAN[0] * end.dy + _FAN[1] * end.dx
    return not bool(np.any(at(state, x, y) == UNKNOWN))
