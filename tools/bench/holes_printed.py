"""The paper's learning as printed, for comparison: middles of long segments, y as a polynomial of x.

Both endpoints are told to the fit, and the filled cells that had been occupied are hits (section 3.1.2).
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from fill.paper_fit import ORDERS, Crossed, crossed, fit
from fill.paper_learning import LEARNABLE, Tally
from fill.paper_loop import NEAR
from fill.paper_segments import Segment, find_segments

_EIGHT: Final = np.ones((3, 3), np.int8)
_SHORTEST: Final = 3
_HOLES: Final = 8  # knocked into each segment
_ENOUGH: Final = 400  # holes in all: more teach nothing new


def knock_outs(wall: NDArray[np.bool_], random: np.random.Generator) -> Tally:
    """Knock the middles out of long segments of ``wall`` ``(rows, cols)``, fill them by every order, count the hits."""
    tally = Tally(
        np.zeros((len(ORDERS), sum(wall.shape)), np.int64), np.zeros((len(ORDERS), sum(wall.shape)), np.int64)
    )
    segments = find_segments(wall, LEARNABLE)
    each = max(1, min(_HOLES, _ENOUGH // max(len(segments), 1)))
    for segment in segments:
        for _ in range(each):
            size = int(random.integers(_SHORTEST, max(segment.length // 3, _SHORTEST) + 1))
            for order, found in _filled(segment, size, wall):
                unit = np.minimum(found.away.astype(np.int64), sum(wall.shape) - 1)
                np.add.at(tally.count[order - 1], unit, 1)
                np.add.at(tally.hits[order - 1], unit, wall[found.cells[:, 0], found.cells[:, 1]])
    return tally


def _filled(segment: Segment, size: int, wall: NDArray[np.bool_]) -> list[tuple[int, Crossed]]:
    """Take ``size`` steps out of the middle of a segment, and fill them by each order.

    A segment that runs round a room is cut in one place only: where its middle is in several, in the first.
    """
    start = (segment.length + 1 - size) // 2
    layers = np.full((3, *wall.shape), False)
    rows, cols = segment.cells.T
    steps = segment.from_first
    for layer, low, high in ((0, start, start + size), (1, start - 1, start), (2, start + size, start + size + 1)):
        layers[layer, rows, cols] = (steps >= low) & (steps < high)
    parts, count = ndimage.label(layers[0], _EIGHT)
    gone = parts == 1
    rim = ndimage.binary_dilation(gone, _EIGHT)
    behind, beyond = np.argwhere(layers[1] & rim), np.argwhere(layers[2] & rim)
    if not count or not len(behind) or not len(beyond):
        return []
    left = wall & ~gone
    ends = behind[0], beyond[0]
    samples = np.concatenate([_around(end, left) for end in ends])
    return [(order, crossed(fit(samples, order, len(wall)), *ends, left)) for order in ORDERS]


def _around(end: NDArray[np.int64], wall: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Cells ``(n, 2)`` of wall fewer than NEAR steps from an endpoint."""
    low = np.maximum(end - NEAR, 0)
    window = wall[low[0] : end[0] + NEAR + 1, low[1] : end[1] + NEAR + 1]
    seed = np.zeros(window.shape, bool)
    seed[tuple(end - low)] = True
    return np.argwhere(ndimage.binary_dilation(seed, _EIGHT, iterations=NEAR - 1, mask=window)) + low
