"""Between which depths the walls stand, for the extrusion."""

from __future__ import annotations

import statistics
from typing import Final

from drivers.readings import Altitude, Depth, Reading

_ASSUMED_M: Final = 1.0
"""Height of the walls while nothing is known of it."""
_TOGETHER_NS: Final = 2_000_000_000
"""An altitude and a depth this near in time are one place of the vehicle."""


class Extent:
    """Collects depths and altitudes; ``height_m`` is floor to ceiling where the operator knows it."""

    def __init__(self, height_m: float | None) -> None:
        self._height_m = height_m
        self._depth: Depth | None = None
        self._deepest_m = 0.0
        self._floors_m: list[float] = []

    def see(self, reading: Reading) -> None:
        """Take a reading of any kind."""
        if isinstance(reading, Depth):
            self._depth = reading
            self._deepest_m = max(self._deepest_m, reading.depth_m)
        elif isinstance(reading, Altitude) and self._depth is not None:
            is_together = abs(reading.t_ns - self._depth.t_ns) <= _TOGETHER_NS
            self._floors_m += [self._depth.depth_m + reading.altitude_m] if is_together else []

    def top_and_floor_m(self) -> tuple[float, float]:
        """Return both depths, positive down.

        The floor is where the altitudes say (their median), else the deepest the vehicle was, and at least the
        configured height down; the top is that height above it, else the water surface.
        """
        if self._floors_m:
            floor_m = statistics.median(self._floors_m)
        else:
            floor_m = max(self._deepest_m, self._height_m or 0.0) or _ASSUMED_M
        return (0.0 if self._height_m is None else floor_m - self._height_m), floor_m
