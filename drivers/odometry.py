"""From what an instrument says about the vehicle's way to displacements in axes that the map knows."""

from __future__ import annotations

import math
from typing import Final

from config.schema import Feed
from drivers.quality import Opinion, worst
from drivers.readings import Odometry
from drivers.statements import Located, Moved

_DRIFT_M_S: Final = 0.001
"""What an instrument takes for motion while there is none."""
_LONGEST_S: Final = 5.0
"""Over a longer silence two places are no displacement: the instrument may have begun anew."""


class Odometer:
    """Displacements of one feed.

    Those in vehicle axes are turned by how the instrument is mounted; those by a north, by the variation that the
    feed's headings get as well.  A displacement that no vehicle makes is bad.
    """

    def __init__(self, feed: Feed) -> None:
        self._share = feed.odometry_sd_pct / 100.0
        self._mount_rad = math.radians(feed.mount_deg)
        self._max_m_s = feed.max_speed_m_s
        self._before: dict[str, Located] = {}

    def moved(self, t_ns: int, source: str, said: Moved) -> Odometry | None:
        """Return the displacement that an instrument tells in the vehicle's axes."""
        if not 0.0 < said.dt_s <= _LONGEST_S:
            return None
        dx_m, dy_m = _turned(said.right_m, said.ahead_m, self._mount_rad)
        return self._reading(t_ns, source, (dx_m, dy_m, said.dt_s), Opinion(said.quality, said.reason), in_vehicle=True)

    def located(self, t_ns: int, source: str, said: Located, variation_deg: float) -> Odometry | None:
        """Return the displacement from the place that the same message told before to this one."""
        before, self._before[source] = self._before.get(source), said
        dt_s = 0.0 if before is None else said.clock_s - before.clock_s
        if before is None or not 0.0 < dt_s <= _LONGEST_S:
            return None
        turned = _turned(said.east_m - before.east_m, said.north_m - before.north_m, math.radians(variation_deg))
        return self._reading(t_ns, source, (*turned, dt_s), Opinion(said.quality, said.reason), in_vehicle=False)

    def _reading(
        self, t_ns: int, source: str, moved: tuple[float, float, float], opinion: Opinion, *, in_vehicle: bool
    ) -> Odometry:
        dx_m, dy_m, dt_s = moved
        way_m = math.hypot(dx_m, dy_m)
        if way_m > self._max_m_s * dt_s + 0.05:
            opinion = worst(Opinion("bad", f"a jump of {way_m:.2f} m in {dt_s:.2f} s"), opinion)
        sd_m = self._share * way_m + _DRIFT_M_S * dt_s
        return Odometry(t_ns, dt_s, dx_m, dy_m, sd_m, in_vehicle, source, opinion.quality, opinion.reason)


def _turned(x_m: float, y_m: float, clockwise_rad: float) -> tuple[float, float]:
    sin, cos = math.sin(clockwise_rad), math.cos(clockwise_rad)
    return cos * x_m + sin * y_m, cos * y_m - sin * x_m
