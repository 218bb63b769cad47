"""Deviation of a compass: what the vehicle's own iron and currents turn it by, heading by heading."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence


class Deviation:
    """A table of deviations, interpolated on the circle: beyond its last heading it goes on to its first one."""

    def __init__(self, points_deg: Sequence[tuple[float, float]]) -> None:
        """Take pairs of a heading as read and what to add to it, in degrees, in any order; none adds nothing."""
        points = sorted((heading % 360.0, added) for heading, added in points_deg)
        self._headings = [heading for heading, _ in points]
        self._added = [added for _, added in points]

    def at(self, heading_deg: float) -> float:
        """Return what to add to ``heading_deg``, east positive."""
        if not self._headings:
            return 0.0
        heading = heading_deg % 360.0
        after = bisect_right(self._headings, heading) % len(self._headings)
        span = (self._headings[after] - self._headings[after - 1]) % 360.0
        share = ((heading - self._headings[after - 1]) % 360.0) / span if span else 0.0
        return self._added[after - 1] + share * (self._added[after] - self._added[after - 1])
