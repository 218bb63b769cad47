"""Texture of walls: what makes one spot of a wall answer louder than the next, fixed to its place."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

_WAVES: Final = 16
_LONGEST_M: Final = 1.6
_SHORTEST_M: Final = 0.07


class Texture:
    """Gain over the plan of a site: log-normal of ``sd_db``, mean one, made of waves of 7 cm to 1.6 m."""

    def __init__(self, seed: int, sd_db: float) -> None:
        rng = np.random.default_rng((seed, 0x7E8))
        length_m = np.geomspace(_SHORTEST_M, _LONGEST_M, _WAVES)
        heading = rng.uniform(0.0, 2.0 * np.pi, _WAVES)
        self._wave = 2.0 * np.pi / length_m * np.stack([np.sin(heading), np.cos(heading)])
        self._phase = rng.uniform(0.0, 2.0 * np.pi, _WAVES)
        # A sum of n sines has a variance of n / 2; nepers of power keep the exponential simple.
        self._scale = sd_db * np.log(10.0) / 10.0 / np.sqrt(_WAVES / 2.0)
        self._mean = (sd_db * np.log(10.0) / 10.0) ** 2 / 2.0

    def at(self, point_m: Floats) -> Floats:
        """Return the gain of power ``(n,)`` at points ``(n, 2)``."""
        waves = np.sin(point_m @ self._wave + self._phase).sum(axis=1)
        return np.asarray(np.exp(self._scale * waves - self._mean), dtype=np.float64)
