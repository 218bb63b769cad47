"""How sure a fill is: logistic models with a prior from elsewhere, taught by the site's own walls.

The paper tabulates hits by distance and runs a cubic through them (section 3.1.2), which leaves 0 to 1 beyond its
last bin.  Here two logistic models, one for a hole as a whole and one for its cells, start from weights learnt on
other places and move as far as the site's own knocked-out holes can pull them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

_STEPS: Final = 8
_LOWEST: Final = 0.02
_HIGHEST: Final = 0.98


@dataclass(frozen=True, slots=True)
class Logistic:
    """A logistic model: ``weights`` ``(k,)`` and the ``precision`` ``(k, k)`` with which they are known."""

    weights: NDArray[np.float64]
    precision: NDArray[np.float64]

    def chance(self, features: NDArray[np.float64]) -> NDArray[np.float64]:
        """Probability ``(n,)`` for features ``(n, k)``."""
        return sigmoid(features @ self.weights)

    def taught(self, features: NDArray[np.float64], right: NDArray[np.float64], count: NDArray[np.float64]) -> Logistic:
        """Return the model after outcomes ``right`` ``(n,)`` of 0 or 1 were seen, each counting as ``count`` ``(n,)``.

        Maximum a posteriori, by Newton's method.
        """
        weights = self.weights
        curvature = self.precision
        for _ in range(_STEPS):
            chance = sigmoid(features @ weights)
            slope = features.T @ (count * (right - chance)) - self.precision @ (weights - self.weights)
            curvature = self.precision + (features * (count * chance * (1.0 - chance))[:, None]).T @ features
            weights = weights + np.linalg.solve(curvature, slope)
        return Logistic(weights, curvature)


@dataclass(frozen=True, slots=True)
class Belief:
    """What is believed about fills: ``hole`` judges candidates, ``cell`` the cells of a hole by their distance."""

    hole: Logistic
    cell: Logistic

    def certainty(self, chance: float, away: NDArray[np.float64]) -> NDArray[np.float32]:
        """Certainty ``(n,)`` of the cells of a hole of this ``chance``, ``away`` ``(n,)`` cells from the nearer end.

        It never grows with distance, and stays within 2 and 98 per cent: nothing guessed is told as sure.
        """
        chances = self.cell.chance(cell_features(np.full(len(away), chance), away))
        return np.clip(chances, _LOWEST, _HIGHEST).astype(np.float32)


def falling(
    cell: Logistic, features: NDArray[np.float64], right: NDArray[np.float64], count: NDArray[np.float64]
) -> Logistic:
    """Return the model of cells after these outcomes; should they say that distance helps, distance does not count."""
    taught = cell.taught(features, right, count)
    if taught.weights[2] <= 0.0:
        return taught
    level = Logistic(cell.weights[:2], cell.precision[:2, :2]).taught(features[:, :2], right, count)
    return Logistic(np.append(level.weights, 0.0), taught.precision)


def cell_features(chance: NDArray[np.float64], away: NDArray[np.float64]) -> NDArray[np.float64]:
    """Features ``(n, 3)`` of filled cells: one, log-odds of the hole, log of the distance to the nearer end."""
    clipped = np.clip(chance, 1e-3, 1.0 - 1e-3)
    return np.stack([np.ones_like(away), np.log(clipped / (1.0 - clipped)), np.log1p(away)], axis=1)


def sigmoid(x: NDArray[np.float64]) -> NDArray[np.float64]:
    """Logistic function, safe for any size of ``x``."""
    return 0.5 * (1.0 + np.tanh(0.5 * x))


def hole_certainty(chance: float) -> float:
    """Certainty that a whole fill is right, within 2 and 98 per cent."""
    return min(max(chance, _LOWEST), _HIGHEST)
