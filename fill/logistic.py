"""A logistic model that can be taught."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from mapping.trees import sigmoid as sigmoid

_STEPS: Final = 8


@dataclass(frozen=True, slots=True)
class Logistic:
    """A logistic model: ``weights`` ``(k,)`` and the ``precision`` ``(k, k)`` with which they are known."""

    weights: NDArray[np.float64]
    precision: NDArray[np.float64]

    def chance(self, features: NDArray[np.float64]) -> NDArray[np.float64]:
        """Probability ``(n,)`` for features ``(n, k)``; that of one row does not hang on the others."""
        return sigmoid(np.sum(features * self.weights, axis=1))

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
