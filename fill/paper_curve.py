"""The paper's certainty: hits by distance, as a curve (section 3.1.2).

Each order's share of hits by unit of arc is fitted with a cubic.  The paper calls the curve a probability distribution;
it is the share of filled cells that are right at a distance.  A cubic runs off outside the bins that it was fitted to:
there the value of the last bin is held, and all is kept within 0 and 1.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fill.paper_fit import ORDERS
from fill.paper_learning import Tally

_DEFAULT: Final = 0.5  # where there was nothing to learn from


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


def certainty_curves(tally: Tally) -> dict[int, CertaintyCurve]:
    """Return the curve of each order."""
    return {order: _curve(*each) for order, *each in zip(ORDERS, tally.count, tally.hits, strict=True)}


def _curve(count: NDArray[np.int64], hits: NDArray[np.int64]) -> CertaintyCurve:
    bins = np.flatnonzero(count)
    if not len(bins):
        return CertaintyCurve(np.array([_DEFAULT]), 0.0, 0.0)
    middle = bins + 0.5
    weights = np.polynomial.polynomial.polyfit(middle, hits[bins] / count[bins], min(3, len(bins) - 1))
    return CertaintyCurve(np.asarray(weights, np.float64), float(middle[0]), float(middle[-1]))
