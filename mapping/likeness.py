"""How much likelier it is that looks from afar hear one and the same grain than that each hears its own.

The grain of a wall is a Gaussian process over the plan, speckle one over bearing, range and the vehicle's place.  A
path tells which looks fall on one spot.  Held against it is the same path, on which what was heard from one place, or
in one go, is all that is alike: so nothing hangs on how much of a wall was heard more than once.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.linalg import solve_triangular

from mapping.grain import Grain
from mapping.path import HERE, THERE, Floats

OWN = 0.45
"""Share of the variance of levels that is the wall's own ..."""
ALONG_M = 0.11
"""... and how far along the wall it is alike."""
RECEIVER = 0.15
"""Share of the rest that differs from ping to ping; the rest of that is speckle, alike ..."""
SPECKLE_RAD, SPECKLE_RANGE_M, SPECKLE_PLACE_M = math.radians(4.0), 0.1, 0.06
"""... over so much bearing, range and movement."""
ONE_PLACE_M = 0.15
"""What was heard under way so near to a rest is heard from there."""


class Likeness:
    """Log-likelihood ratio of paths, by the grain of walls along them."""

    def __init__(self, grain: Grain) -> None:
        self._grain = grain
        arm = grain.marks.arm_m
        direction, range_m = np.arctan2(arm[:, 0], arm[:, 1]), np.hypot(arm[:, 0], arm[:, 1])
        turn = np.abs((direction[:, None] - direction + math.pi) % (2.0 * math.pi) - math.pi)
        beside = turn / SPECKLE_RAD + np.abs(range_m[:, None] - range_m) / SPECKLE_RANGE_M
        self._speckle = (1.0 - OWN) * (1.0 - RECEIVER) * np.exp(-beside)

    def of(self, path: Floats) -> float:
        """Log-likelihood ratio of a path ``(states, 3)``."""
        marks = self._grain.marks
        places, _ = marks.places(path)
        after = np.minimum(marks.state + 1, len(path) - 1)
        at = (path[marks.state] + marks.share[:, None] * (path[after] - path[marks.state]))[:, :2]
        own = OWN * np.exp(-0.5 * _square(places) / ALONG_M**2)
        rest = self._speckle * np.exp(-np.sqrt(_square(at)) / SPECKLE_PLACE_M)
        rest[np.diag_indices(len(rest))] += (1.0 - OWN) * RECEIVER
        here, there = (np.hypot(*(at - path[end, :2]).T) < ONE_PLACE_M for end in (0, -1))
        place = np.where(here, HERE, np.where(there, THERE, marks.group))
        return self._log_density(own + rest) - self._log_density(own * (place[:, None] == place) + rest)

    def _log_density(self, covariance: Floats) -> float:
        root = np.linalg.cholesky(covariance)
        white = solve_triangular(root, self._grain.level, lower=True, check_finite=False)
        return float(-0.5 * white @ white - np.log(np.diag(root)).sum())


def _square(places: Floats) -> Floats:
    length2 = (places**2).sum(axis=1)
    return np.asarray(np.maximum(length2[:, None] + length2 - 2.0 * places @ places.T, 0.0), dtype=np.float64)
