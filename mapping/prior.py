"""Where a scan may have been made, before its walls are looked at."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

EDGE_M = 0.3
"""Softness of the edge of the disc."""
CLOUD_SHARE = 0.998
"""How far a cloud is trusted against the disc."""
DISTURBED_SD_RAD = math.radians(40.0)
LOG_DISTURBED = math.log(0.005)
"""How far iron nearby turns a compass, and how seldom, as a share of the density of one that is right."""
HINT_SD_M = 0.3
"""Least uncertainty of a pilot's hint."""
DISAGREE = 9.0
"""Square of the distance, in standard deviations, from which pilot and cloud disagree."""

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Cloud:
    """A normal over x_m and y_m: what was seen of the way.  ``covariance`` is ``(2, 2)``."""

    x_m: float
    y_m: float
    covariance: Floats

    @property
    def sd_m(self) -> float:
        """Largest standard deviation in any direction."""
        return math.sqrt(float(np.linalg.eigvalsh(self.covariance)[-1]))


@dataclass(frozen=True, slots=True)
class Prior:
    """Where the scan may have been made: a disc of ``reach_m`` about a place, or a normal with ``sd_m``.

    With a ``cloud``, there; or, with what trust is left, anywhere in the disc.  Without a compass ``heading_sd_rad`` is
    infinite; where the compass may be ``disturbed``, iron nearby may turn it by much more than that.
    """

    x_m: float
    y_m: float
    reach_m: float
    heading_rad: float
    heading_sd_rad: float
    gaussian: bool = False
    cloud: Cloud | None = None
    disturbed: bool = False

    @property
    def led_to(self) -> Cloud | None:
        """Where odometry or the way led, where that is surer than any pilot."""
        if self.cloud is not None:
            return self.cloud if self.cloud.sd_m <= HINT_SD_M else None
        led = self.gaussian and self.reach_m < HINT_SD_M
        return Cloud(self.x_m, self.y_m, self.reach_m**2 * np.eye(2)) if led else None

    @property
    def is_led(self) -> bool:
        """Whether odometry or the way led here."""
        return self.led_to is not None

    def draw(self, n: int, rng: np.random.Generator) -> Floats:
        """Draw ``(n, 3)`` poses; with a cloud half of them from it."""
        if self.gaussian:
            away = rng.normal(0.0, self.reach_m, (n, 2))
        else:
            radius, turn = (self.reach_m + 2.0 * EDGE_M) * np.sqrt(rng.random(n)), rng.random(n) * 2.0 * math.pi
            away = np.stack([radius * np.cos(turn), radius * np.sin(turn)], axis=1)
        xy = away + np.array([self.x_m, self.y_m])
        if self.cloud is not None:
            mean = np.array([self.cloud.x_m, self.cloud.y_m])
            xy[::2] = mean + rng.normal(0.0, 1.0, (len(xy[::2]), 2)) @ np.linalg.cholesky(self.cloud.covariance).T
        return np.column_stack([xy, self.heading_rad + self._turns(n, rng)])

    def _turns(self, n: int, rng: np.random.Generator) -> Floats:
        if math.isinf(self.heading_sd_rad):
            return rng.uniform(-math.pi, math.pi, n)
        return rng.normal(0.0, DISTURBED_SD_RAD if self.disturbed else self.heading_sd_rad, n)

    @property
    def effort(self) -> int:
        """How many times more particles it takes than with a compass that is believed."""
        return 8 if math.isinf(self.heading_sd_rad) else 4 if self.disturbed else 1

    def astray(self, pose: Floats) -> float:
        """Tell how many standard deviations a pose ``(3,)`` is from the cloud, or from where odometry led; else 0."""
        if self.cloud is None:
            return math.hypot(pose[0] - self.x_m, pose[1] - self.y_m) / self.reach_m if self.is_led else 0.0
        away = pose[:2] - [self.cloud.x_m, self.cloud.y_m]
        return math.sqrt(float(away @ np.linalg.solve(self.cloud.covariance, away)))

    def log_density(self, poses: Floats) -> Floats:
        """Log-density ``(n,)`` of poses ``(n, 3)``, up to a constant."""
        away = np.hypot(poses[:, 0] - self.x_m, poses[:, 1] - self.y_m)
        off = away / self.reach_m if self.gaussian else np.maximum(away - self.reach_m, 0.0) / EDGE_M
        place = -0.5 * off**2
        if self.cloud is not None:
            area = (2.0 if self.gaussian else 1.0) * math.pi * self.reach_m**2
            apart = poses[:, :2] - [self.cloud.x_m, self.cloud.y_m]
            near = -0.5 * (apart @ np.linalg.inv(self.cloud.covariance) * apart).sum(axis=1)
            near -= math.log(2.0 * math.pi) + 0.5 * math.log(np.linalg.det(self.cloud.covariance))
            place = np.logaddexp(math.log(1.0 - CLOUD_SHARE) + place, math.log(CLOUD_SHARE * area) + near)
        turn = (poses[:, 2] - self.heading_rad + math.pi) % (2.0 * math.pi) - math.pi
        told = -0.5 * (turn / self.heading_sd_rad) ** 2
        if self.disturbed:
            told = np.logaddexp(told, LOG_DISTURBED - 0.5 * (turn / DISTURBED_SD_RAD) ** 2)
        return np.asarray(place + told, dtype=np.float64)


@dataclass(frozen=True, slots=True)
class Hint:
    """The pilot's word, or odometry's, on the way since the last station, east and north."""

    dx_m: float
    dy_m: float
    sd_m: float
    least_sd_m: float = HINT_SD_M

    def then(self, other: Hint) -> Hint:
        """Join this hint and the one for the way after it."""
        return Hint(self.dx_m + other.dx_m, self.dy_m + other.dy_m, math.hypot(self.sd_m, other.sd_m))

    def turned(self, turn_rad: float) -> Hint:
        """Tell the same in axes that are turned clockwise by so much against the compass."""
        sin, cos = math.sin(turn_rad), math.cos(turn_rad)
        return replace(self, dx_m=cos * self.dx_m + sin * self.dy_m, dy_m=cos * self.dy_m - sin * self.dx_m)

    def prior(self, from_x_m: float, from_y_m: float, heading_rad: float, heading_sd_rad: float) -> Prior:
        """Say where a scan may have been made that follows a known place."""
        sd_m = max(self.sd_m, self.least_sd_m)
        return Prior(from_x_m + self.dx_m, from_y_m + self.dy_m, sd_m, heading_rad, heading_sd_rad, gaussian=True)


def agreed(prior: Prior, cloud: Cloud | None) -> Prior:
    """Add a cloud to a prior; what the pilot says and the cloud must agree, or the pilot is believed."""
    if cloud is None or not prior.gaussian:
        return replace(prior, cloud=cloud)
    away = np.array([cloud.x_m - prior.x_m, cloud.y_m - prior.y_m])
    total = cloud.covariance + prior.reach_m**2 * np.eye(2)
    if away @ np.linalg.solve(total, away) > DISAGREE:
        return prior
    gain = prior.reach_m**2 * np.linalg.inv(total)
    x_m, y_m = np.array([prior.x_m, prior.y_m]) + gain @ away
    return replace(prior, cloud=Cloud(float(x_m), float(y_m), gain @ cloud.covariance))
