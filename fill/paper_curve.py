"""The paper's certainty: hits by distance, in holes knocked into the site's own walls (section 3.1.2).

Learning is as printed: middles of long segments are taken out with both endpoints told to the fit, the filled cells
that had been occupied are hits, and each order's share of hits by unit of arc is fitted with a cubic.  The paper calls
the curve a probability distribution; it is the share of filled cells that are right at a distance.  A cubic runs off
outside the bins that it was fitted to: there the value of the last bin is held, and all is kept within 0 and 1.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from fill.paper_fit import ORDERS, Crossed, crossed, fit
from fill.paper_loop import NEAR
from fill.paper_segments import Segment, find_segments

_EIGHT: Final = np.ones((3, 3), np.int8)
_LEARNABLE: Final = 9
_SHORTEST: Final = 3
_HOLES: Final = 8  # knocked into each segment
_ENOUGH: Final = 400  # holes in all: more teach nothing new
_DEFAULT: Final = 0.5  # where there was nothing to learn from


@dataclass(frozen=True, slots=True)
class Tally:
    """Filled cells ``(n,)`` of knocked-out holes: ``order``, ``away`` (d_e), ``hit``: whether it had been occupied."""

    order: NDArray[np.int64]
    away: NDArray[np.float64]
    hit: NDArray[np.bool_]

    @property
    def positives(self) -> float:
        """Share of filled cells that had been occupied, as in the paper's Table 1; nan without any."""
        return float(self.hit.mean()) if len(self.hit) else float("nan")


@dataclass(frozen=True, slots=True)
class CertaintyCurve:
    """Cubic over the distance to the nearer endpoint, known from ``low`` to ``high`` cells."""

    weights: NDArray[np.float64]
    low: float
    high: float

    def certainty(self, away: NDArray[np.float64]) -> NDArray[np.float64]:
        """Certainty ``(n,)`` of cells ``away`` ``(n,)`` cells of arc from the nearer endpoint."""
        held = np.clip(away, self.low, self.high)
        return np.clip(np.polynomial.polynomial.polyval(held, self.weights), 0.0, 1.0)


def knock_outs(wall: NDArray[np.bool_], random: np.random.Generator) -> Tally:
    """Knock the middles out of long segments of ``wall`` ``(rows, cols)``, fill them by every order, count the hits."""
    orders: list[NDArray[np.int64]] = []
    away: list[NDArray[np.float64]] = []
    hits: list[NDArray[np.bool_]] = []
    segments = find_segments(wall, _LEARNABLE)
    each = max(1, min(_HOLES, _ENOUGH // max(len(segments), 1)))
    for segment in segments:
        for _ in range(each):
            size = int(random.integers(_SHORTEST, max(segment.length // 3, _SHORTEST) + 1))
            for order, found in _filled(segment, size, wall):
                orders.append(np.full(len(found.cells), order, np.int64))
                away.append(found.away)
                hits.append(wall[found.cells[:, 0], found.cells[:, 1]])
    if not orders:
        return Tally(np.zeros(0, np.int64), np.zeros(0), np.zeros(0, bool))
    return Tally(np.concatenate(orders), np.concatenate(away), np.concatenate(hits))


def certainty_curves(tally: Tally) -> dict[int, CertaintyCurve]:
    """Return the curve of each order."""
    return {order: _curve(tally.away[tally.order == order], tally.hit[tally.order == order]) for order in ORDERS}


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


def _curve(away: NDArray[np.float64], hit: NDArray[np.bool_]) -> CertaintyCurve:
    unit = np.floor(away).astype(np.int64)
    count = np.bincount(unit)
    bins = np.flatnonzero(count)
    if not len(bins):
        return CertaintyCurve(np.array([_DEFAULT]), 0.0, 0.0)
    share = np.bincount(unit, hit)[bins] / count[bins]
    middle = bins + 0.5
    weights = np.polynomial.polynomial.polyfit(middle, share, min(3, len(bins) - 1))
    return CertaintyCurve(np.asarray(weights, np.float64), float(middle[0]), float(middle[-1]))
