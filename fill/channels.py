"""Ways that the unknown itself shows: where water was seen on both sides of a strip, the wall stood inside the strip.

The lost wall is looked for among the cells that were not seen free, as the cheapest way from end to end; what a cell
costs hangs on how far it is from water.  Corners, steps and crooked walls come out as they are, without a curve that
would have to be guessed.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray
from skimage.graph import MCP_Geometric

from fill.curves import Curve, sampled
from fill.scene import Scene
from fill.segments import End, cell_at

_SHORTEST: Final = 3.0  # cells: over less there is nothing to be led by
_ASIDE: Final = 0.35  # of the gap: so far off the chord a way is looked for
_BEYOND: Final = 4  # cells more
_LONGEST: Final = 1.9  # times the gap: a way that is longer goes elsewhere
_DEEP: Final = 4.0  # cells from water, where the middle of a strip is as good as its sides
_SHY: Final = 3.0
_OFF: Final = 1.5  # what a cell costs that lies a cell too near to water or too far from it
_MOST: Final = 3.0
_SMOOTHINGS: Final = 2

Layer = NDArray[np.float64]


def channels(a: End, b: End, scene: Scene) -> list[tuple[Curve, NDArray[np.int32]]]:
    """Ways between two ends: at the depth of the walls behind the water's edge, and in the middle of the unknown.

    With each come the cells ``(n, 2)`` that it was found in, row and column: the curve is smooth, and where the unknown
    is narrow it may touch water that they do not.
    """
    gap = math.hypot(b.x - a.x, b.y - a.y)
    if gap < _SHORTEST:
        return []
    low, high = window(a, b, gap, scene.state.shape)
    water = scene.water[low[0] : high[0], low[1] : high[1]]
    depth = (a.half + b.half) / 2.0 + 1.0
    shore = 1.0 + _OFF * np.minimum(np.abs(water - depth), _MOST)
    middle = 1.0 + _SHY * np.clip((_DEEP - water) / (_DEEP - 1.0), 0.0, 1.0) ** 2
    found = []
    for name, cost in (("shore", shore), ("channel", middle)):
        way = _way(np.where(water <= 0.0, -1.0, cost), a, b, low)
        if way is not None and len(way) <= _LONGEST * gap + _BEYOND:
            found.append((Curve(name, sampled(_smooth(way))), cell_at(way[:, ::-1]).astype(np.int32)))
    return found


def window(a: End, b: End, gap: float, shape: tuple[int, ...]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """First and last row and column between which a way is looked for."""
    margin = int(_ASIDE * gap) + _BEYOND
    low = np.array([int(min(a.y, b.y)) - margin, int(min(a.x, b.x)) - margin])
    high = np.array([int(max(a.y, b.y)) + margin + 2, int(max(a.x, b.x)) + margin + 2])
    return np.maximum(low, 0), np.minimum(high, np.array(shape))


def _way(cost: Layer, a: End, b: End, low: NDArray[np.int64]) -> Layer | None:
    """Points ``(n, 2)`` of x and y on the cheapest way from end to end; costs below 0 forbid a cell."""
    cells = cheapest(cost, a, b, low)
    if cells is None:
        return None
    way = cells[:, ::-1].astype(np.float64)
    way[0], way[-1] = (a.x, a.y), (b.x, b.y)
    return way


def cheapest(cost: Layer, a: End, b: End, low: NDArray[np.int64]) -> NDArray[np.int64] | None:
    """Cells ``(n, 2)`` of the cheapest way from end to end through a window whose first cell is ``low``.

    Costs below 0 forbid a cell; None where no way leads through.
    """
    first, last = (
        tuple(np.clip(cell_at(np.array([end.y, end.x])) - low, 0, np.array(cost.shape) - 1).tolist()) for end in (a, b)
    )
    if cost[first] < 0.0 or cost[last] < 0.0:
        return None
    search = MCP_Geometric(cost)
    total, _ = search.find_costs([first], [last])
    if not np.isfinite(total[last]):
        return None
    return np.array(search.traceback(last), np.int64) + low


def _smooth(way: Layer) -> Layer:
    """Take the stairs out of a way, its ends kept."""
    for _ in range(_SMOOTHINGS):
        if len(way) > 4:
            way = np.concatenate([way[:1], (way[:-2] + way[1:-1] + way[2:]) / 3.0, way[-1:]])
    return way
