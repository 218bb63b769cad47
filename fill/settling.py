"""Settling a fill on the water's edge: where water was seen to end beside a curve, the wall stands right there.

A curve tells where a wall goes to a cell or two; the edge of the water tells it to the cell.  A drawn path is moved by
no more than that, onto the depth behind the edge at which the walls on both sides of the hole have their middle, and
only where the edge goes on from the walls into the hole: about a hole whose water was not seen either, the edge is that
of the unseen, and lies further off.
"""

from __future__ import annotations

import dataclasses
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from skimage.graph import MCP_Geometric

from fill.candidates import Candidate
from fill.freedom import clear_path
from fill.memory import Memory
from fill.scene import FARTHEST
from mapping.values import FREE, OCCUPIED

_NEAR: Final = 3.3  # cells from the curve
_EDGE: Final = 0.75  # cells off the depth that still are on it
_FOLLOWS: Final = 0.5  # of a settled path lies on the edge
_OFF: Final = 3.0  # what a cell costs for each cell that it is off the depth ...
_AWAY: Final = 0.15  # ... and off the curve
_TIP: Final = 3  # cells of a wall next to its end: beside them water was seen, or the hole's was lost
_AT_TIPS: Final = 0.8  # cells that the edge is off there
_JUMP: Final = slice(1, 4)  # cells of a settled path next to an end ...
_MOST_JUMP: Final = 0.95  # ... that are no further from the curve at both: the unseen begins with a step
_WET: Final = 1.7  # cells that the middle of a wall is further from water than its face, at most
_SHORTEST: Final = 3
_LOOKED: Final = int(_NEAR + FARTHEST) + 3  # cells about a path
_LONGER: Final = 1.4  # times the curve: more is a detour


def settle(candidate: Candidate, state: NDArray[np.uint8], memory: Memory) -> Candidate:
    """Return what ``settled`` does, from memory where nothing near changed."""
    path = candidate.path
    low, high = path.min(axis=0) - _LOOKED, path.max(axis=0) + _LOOKED + 1
    box = int(low[0]), int(low[1]), int(high[0]), int(high[1])
    key = ("settled", path.tobytes(), candidate.half_a, candidate.half_b)
    moved = memory.recall(key, lambda: (box, settled(candidate, state, memory.water(state)).path))
    return candidate if moved is path else dataclasses.replace(candidate, path=moved)


def settled(candidate: Candidate, state: NDArray[np.uint8], water: NDArray[np.float64]) -> Candidate:
    """Return the candidate with its path on the water's edge, or as it is where there is no such edge."""
    path = candidate.path
    depth = _depth(candidate, water) if len(path) >= _SHORTEST else None
    if depth is None:
        return candidate
    margin = int(_NEAR) + 2
    low = np.maximum(path.min(axis=0) - margin, 0)
    high = np.minimum(path.max(axis=0) + margin + 1, state.shape)
    window = slice(low[0], high[0]), slice(low[1], high[1])
    bare = np.ones(state[window].shape, bool)
    bare[tuple((path - low).T)] = False
    away = ndimage.distance_transform_edt(bare)
    off = np.abs(water[window] - depth)
    cost = 1.0 + _OFF * np.minimum(off, _NEAR) + _AWAY * away
    cost[state[window] == OCCUPIED] = 0.5
    cost[(away > _NEAR) | (state[window] == FREE)] = -1.0
    moved = _cheapest(cost, path[0] - low, path[-1] - low)
    if moved is None or len(moved) > _LONGER * len(path) + 2:
        return candidate
    fresh = state[window][tuple(moved.T)] != OCCUPIED
    if not fresh.any() or np.mean(off[tuple(moved[fresh].T)] <= _EDGE) < _FOLLOWS:
        return candidate
    aside = away[tuple(moved.T)]
    if min(aside[_JUMP].mean(), aside[::-1][_JUMP].mean()) > _MOST_JUMP:
        return candidate
    joined = clear_path((moved + low).astype(np.int32), state)
    return candidate if joined is None else dataclasses.replace(candidate, path=joined)


def _depth(candidate: Candidate, water: NDArray[np.float64]) -> float | None:
    """How far from water the fill's middle is, as that of its walls; None where the edge does not go on from them."""
    depths = []
    for end in candidate.ends:
        behind = np.rint(end.line[:, ::-1]).astype(np.int64)
        along = _at(water, behind)
        depth = float(np.median(along[_TIP:])) if len(along) > _TIP else np.inf
        if depth > end.half + _WET or np.mean(np.abs(along[:_TIP] - depth)) > _AT_TIPS:
            return None
        depths.append(depth)
    return sum(depths) / 2.0


def _at(water: NDArray[np.float64], cells: NDArray[np.int64]) -> NDArray[np.float64]:
    rows, cols = np.clip(cells, 0, np.array(water.shape) - 1).T
    return np.asarray(water[rows, cols], np.float64)


def _cheapest(cost: NDArray[np.float64], first: NDArray[np.int64], last: NDArray[np.int64]) -> NDArray[np.int64] | None:
    start, finish = tuple(first.tolist()), tuple(last.tolist())
    if cost[start] < 0.0 or cost[finish] < 0.0:
        return None
    search = MCP_Geometric(cost, fully_connected=False)
    total, _ = search.find_costs([start], [finish])
    return np.array(search.traceback(finish), np.int64) if np.isfinite(total[finish]) else None
