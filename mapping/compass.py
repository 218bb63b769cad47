"""Headings and depths along the time line: what the vehicle's heading was at the moment of a ping."""

from __future__ import annotations

import bisect
import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

KEEP_NS = 120_000_000_000
"""Readings older than this are forgotten: a circle of the slowest head takes less."""
SHARES: Final = (1.0, 0.8, 0.8, 0.3, 0.3)
"""What is known before of a compass's bias and of each wave's amplitude, in standard deviations of its error."""


def waves_of(heading_rad: NDArray[np.float64]) -> NDArray[np.float64]:
    """Give the waves ``(n, 5)`` by which a compass's error goes with the heading: one, and two of one and two cycles.

    Iron of the vehicle that is magnetic makes one cycle to the turn, and soft iron two.
    """
    waves = [np.ones_like(heading_rad), *(wave(k * heading_rad) for k in (1, 2) for wave in (np.sin, np.cos))]
    return np.stack(waves, axis=1)


def wrap(angle_rad: float) -> float:
    """Bring an angle into [-pi, pi)."""
    return (angle_rad + math.pi) % (2.0 * math.pi) - math.pi


class Track:
    """A quantity over time, in order of its stamps; angles are kept unwrapped."""

    def __init__(self, *, angular: bool) -> None:
        self._angular = angular
        self._t_ns: list[int] = []
        self._value: list[float] = []

    def __len__(self) -> int:
        return len(self._t_ns)

    @property
    def latest_ns(self) -> int:
        """Stamp of the latest reading; there must be one."""
        return self._t_ns[-1]

    def add(self, t_ns: int, value: float) -> None:
        """Take a reading; one that comes late finds its place."""
        at = bisect.bisect_right(self._t_ns, t_ns)
        if self._angular and self._value:
            near = self._value[max(at - 1, 0)]
            value = near + wrap(value - near)
        self._t_ns.insert(at, t_ns)
        self._value.insert(at, value)
        if len(self._t_ns) % 256 == 0:
            old = bisect.bisect_left(self._t_ns, self._t_ns[-1] - KEEP_NS)
            del self._t_ns[:old], self._value[:old]

    def at(self, t_ns: int) -> float:
        """Give the value at a moment, between its neighbours in time; the nearest one beyond the ends."""
        return float(np.interp(t_ns, self._t_ns, self._value))

    def rate(self, t_ns: int, span_ns: int = 1_000_000_000) -> float:
        """Give the change per second over the span before a moment, 0 where too little is known."""
        if len(self) < 2 or self._t_ns[0] > t_ns - span_ns:
            return 0.0
        return (self.at(t_ns) - self.at(t_ns - span_ns)) / (span_ns * 1e-9)

    def within(self, start_ns: int, end_ns: int) -> NDArray[np.float64]:
        """Values of the readings from start to end, ``(n,)`` float64, possibly none."""
        first = bisect.bisect_left(self._t_ns, start_ns)
        return np.array(self._value[first : bisect.bisect_right(self._t_ns, end_ns)], dtype=np.float64)
