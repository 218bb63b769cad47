"""What an odometry feed says of the way between two scans; nothing here is needed where there is none."""

from __future__ import annotations

import math
from bisect import bisect_left

import numpy as np

from drivers.readings import Odometry
from mapping.values import Displacement

REST_SD_M = 0.03
"""A scan is a mean over a rest, and a vehicle at rest sways."""
UNSEEN_M_S = 0.3
"""How far a vehicle may go in time of which nothing is told."""
LEAST_TOLD = 0.8
"""Share of the time between two scans that must be told of."""
MOST = 200_000
"""Readings that are kept while no scan comes."""


class Odometer:
    """Displacements along the time line, summed up east and north by the compass."""

    def __init__(self) -> None:
        self._middle_ns: int | None = None
        self._t_ns: list[int] = []
        self._sums: list[tuple[float, float, float, float]] = []  # x_m, y_m, sd_m, seconds told of

    def add(self, reading: Odometry, heading_rad: float) -> None:
        """Take a reading and the heading of its moment; one that comes late is left out."""
        if self._t_ns and reading.t_ns <= self._t_ns[-1]:
            return
        dx_m, dy_m = reading.dx_m, reading.dy_m
        if reading.in_vehicle:
            sin, cos = math.sin(heading_rad), math.cos(heading_rad)
            dx_m, dy_m = cos * dx_m + sin * dy_m, cos * dy_m - sin * dx_m
        if not self._t_ns:
            self._t_ns.append(reading.t_ns - round(reading.dt_s * 1e9))
            self._sums.append((0.0, 0.0, 0.0, 0.0))
        x_m, y_m, sd_m, told_s = self._sums[-1]
        self._t_ns.append(reading.t_ns)
        self._sums.append((x_m + dx_m, y_m + dy_m, sd_m + reading.sd_m, told_s + reading.dt_s))
        if len(self._t_ns) > MOST:
            self.forget(self._t_ns[MOST // 2])

    def since_last(self, middle_ns: int) -> Displacement | None:
        """Give the displacement from the middle of the scan before, as told here, to that of this one."""
        before_ns, self._middle_ns = self._middle_ns, middle_ns
        if before_ns is None:
            return None
        moved = self.between(before_ns, middle_ns)
        self.forget(middle_ns)
        return moved

    def between(self, start_ns: int, end_ns: int) -> Displacement | None:
        """Give the displacement from one moment to another; None where too little is told of it."""
        if not self._t_ns or end_ns <= start_ns:
            return None
        sums = np.array(self._sums)
        ends = np.array([[np.interp(t, self._t_ns, column) for column in sums.T] for t in (start_ns, end_ns)])
        dx_m, dy_m, sd_m, told_s = ends[1] - ends[0]
        passed_s = (end_ns - start_ns) * 1e-9
        if told_s < LEAST_TOLD * passed_s:
            return None
        sd_m += REST_SD_M + UNSEEN_M_S * max(0.0, passed_s - told_s)
        return Displacement(float(dx_m), float(dy_m), float(sd_m))

    def forget(self, before_ns: int) -> None:
        """Forget what came before a moment, but for the last reading."""
        old = max(0, bisect_left(self._t_ns, before_ns) - 1)
        del self._t_ns[:old], self._sums[:old]
