"""The ways between scans, each followed once: where they lead from a station of the map."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from config.schema import Map
from mapping.prior import Cloud
from mapping.sight import Sight
from mapping.traverse import traverse
from mapping.values import Pose

REST_SD_M = 0.05
"""A scan is a mean over a rest, and a vehicle at rest sways: no way leads there more surely."""
MOST = 3
"""So many ways are joined."""


class Strides:
    """Displacements from each scan to the next, kept: they depend on nothing else."""

    def __init__(self, config: Map) -> None:
        self._config = config
        self._known: dict[int, Cloud | None] = {}

    def cloud(self, sights: Sequence[Sight], base: int, to: int, at: Pose) -> Cloud | None:
        """Say where the ways lead from a station at a pose to a scan before or after it; None where one is missing."""
        if abs(to - base) > MOST:
            return None
        known = [self._stride(sights, k) for k in range(min(base, to) + 1, max(base, to) + 1)]
        seen = [each for each in known if each is not None]
        if len(seen) < len(known) or not seen:
            return None
        sign = 1.0 if base < to else -1.0
        turn = at.heading_rad - sights[base].scan.heading_rad
        c, s = math.cos(turn), math.sin(turn)
        by = np.array([[c, s], [-s, c]])  # clockwise
        x_m, y_m = sign * by @ np.array([[each.x_m, each.y_m] for each in seen]).sum(axis=0) + [at.x_m, at.y_m]
        covariance = by @ np.sum([each.covariance for each in seen], axis=0) @ by.T
        return Cloud(float(x_m), float(y_m), covariance + len(seen) * REST_SD_M**2 * np.eye(2))

    def _stride(self, sights: Sequence[Sight], k: int) -> Cloud | None:
        """Tell how far it is from the scan before to scan ``k``."""
        way = sights[k].scan.way
        if k not in self._known:
            self._known[k] = None if way is None else traverse(sights[k - 1], sights[k], way, self._config)
        return self._known[k]
