"""The way between two scans: a cloud of particles carried along by the pings taken under way.

No odometry and no thrust is known: each particle walks at random, with a velocity that holds for a while, and every
beam weighs the cloud by where its echo would then lie in what is known of the map.  An echo that would lie where
nothing is known weighs as much as echoes usually do: else the cloud stays where most is known.  Where the walls say
nothing, along a smooth tunnel, the cloud spreads as far as a vehicle can have gone, and says so.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from config.schema import Map
from mapping.echoes import pick
from mapping.prior import Cloud
from mapping.values import Pose, Returns, Scan, Way
from mapping.view import TRUSTED_SD_M, VAGUE_SD_M, Field

PARTICLES = 400
BATCH = 4
"""Beams weighed together."""
GO_RAD = math.radians(200.0)
"""Beams within this are picked together ..."""
BESIDE_RAD = math.radians(60.0)
"""... with their neighbours on either side: less than a turn, so that its end does not meet its beginning."""
LEG_BEAMS = 5
"""Beams by which the head is seen to turn round: the vehicle's heading trembles."""
FEW_BEAMS = 20
SPEED_M_S = 0.3
"""Standard deviation of the speed to either side ..."""
HOLD_S = 1.5
"""... and how long a speed holds."""
START_SD_M = 0.05
HEADING_SD_RAD = math.radians(1.5)
"""Spread of the compass's error about the one at the start."""
SIGMA_M = 0.15
"""Width of walls to a beam under way."""
WITNESS = 0.25
"""Power of one beam's likelihood: neighbours share their errors."""
ROUGHEN_M = 0.01
WIDEN = 1.4
"""The cloud that is left is too sure of itself: its standard deviation is multiplied by this ..."""
LEAST_SD_M = 0.15
"""... and is no less than this."""
GAP_S = 5.0
"""After a pause of this the way was not seen."""

Floats = NDArray[np.float64]
Beams = NDArray[np.intp]


def ranges_of(way: Way, config: Map) -> tuple[Floats, Floats]:
    """Range of each beam's wall ``(n,)``, nan where it abstains, and its trust, 0 to 1."""
    n = len(way.t_ns)
    range_m, sd_m = np.full(n, np.nan), np.full(n, np.nan)
    for core, around in _goes(way.direction_rad):
        returns = _returns(way, around, config)
        kept = np.isin(around, core)
        range_m[core], sd_m[core] = returns.range_m[kept], returns.sd_m[kept]
    clear = np.isfinite(range_m) & (np.nan_to_num(sd_m, nan=1.0) < VAGUE_SD_M)
    return np.where(clear, range_m, np.nan), np.where(clear, np.minimum(1.0, TRUSTED_SD_M / sd_m), 0.0)


def _goes(direction_rad: Floats) -> Iterator[tuple[Beams, Beams]]:
    """Cut a way into beams to be picked together, less than a turn one way round, each with its neighbours.

    A line of walls that breaks off has horns at its ends: neighbours are picked with them, and not kept.
    """
    step = np.diff(np.unwrap(direction_rad), prepend=direction_rad[:1])
    way_round = np.sign(np.convolve(step, np.ones(LEG_BEAMS), mode="same"))
    leg = np.cumsum(np.abs(np.diff(way_round, prepend=way_round[:1])) > 1.0)
    turned = np.cumsum(np.abs(step))
    for number in range(int(leg.max(initial=-1)) + 1):
        of = np.flatnonzero(leg == number)
        angle = turned[of] - turned[of[0]]
        for k in range(int(angle[-1] / GO_RAD) + 1):
            inside = (angle >= k * GO_RAD) & (angle < (k + 1) * GO_RAD)
            near = (angle >= k * GO_RAD - BESIDE_RAD) & (angle < (k + 1) * GO_RAD + BESIDE_RAD)
            yield of[inside], of[near]


def _returns(way: Way, part: Beams, config: Map) -> Returns:
    if len(part) < FEW_BEAMS:
        silent = np.full(len(part), np.nan)
        return Returns(silent, silent, np.zeros(len(part)))
    t_ns, directions = way.t_ns[part], way.direction_rad[part]
    first, last = int(t_ns[0]), int(t_ns[-1])
    echoes = way.echoes[part]
    return pick(Scan(0, first, last, 0.0, math.nan, directions, echoes, way.bin_m, way.step_rad, "moving"), config)


class Walk:
    """Particles ``(n, 5)``: x_m, y_m, their speeds in m/s, and the compass's error."""

    def __init__(self, start: Pose, compass_rad: float, field: Field, rng: np.random.Generator) -> None:
        """Begin at rest at a pose in the map; ``compass_rad`` is the compass's heading there."""
        self._rng = rng
        self._field = field
        self._scores, self._known = field.scores(SIGMA_M), field.known()
        self._state = np.zeros((PARTICLES, 5))
        self._state[:, :2] = rng.normal(0.0, START_SD_M, (PARTICLES, 2)) + np.array([start.x_m, start.y_m])
        self._state[:, 4] = start.heading_rad - compass_rad + rng.normal(0.0, HEADING_SD_RAD, PARTICLES)
        self._log_weight = np.zeros(PARTICLES)

    def follow(self, way: Way, config: Map) -> bool:
        """Carry the cloud along a way; False where the way has a gap."""
        seconds = np.diff(way.t_ns, prepend=way.t_ns[:1]) * 1e-9
        if seconds.max() > GAP_S:
            return False
        range_m, trust = ranges_of(way, config)
        for begin in range(0, len(seconds), BATCH):
            these = slice(begin, begin + BATCH)
            self._step(float(seconds[these].sum()))
            self._weigh(way.direction_rad[these], range_m[these], trust[these])
        return True

    def _step(self, seconds: float) -> None:
        held = math.exp(-seconds / HOLD_S)
        noise = self._rng.normal(0.0, SPEED_M_S * math.sqrt(1.0 - held**2), (PARTICLES, 2))
        self._state[:, 2:4] = held * self._state[:, 2:4] + noise
        self._state[:, :2] += seconds * self._state[:, 2:4]

    def _weigh(self, direction_rad: Floats, range_m: Floats, trust: Floats) -> None:
        heard = np.isfinite(range_m)
        if not heard.any():
            return
        direction = direction_rad[heard] + self._state[:, 4:5]
        x = self._state[:, :1] + range_m[heard] * np.sin(direction)
        y = self._state[:, 1:2] + range_m[heard] * np.cos(direction)
        cells = self._field.cells(x, y)
        score, known = self._scores.ravel().take(cells), self._known.ravel().take(cells)
        typical = (score * known).sum() / known.sum() if known.any() else 0.0
        self._log_weight += WITNESS * np.where(known > 0.0, score, typical) @ trust[heard]
        weight = np.exp(self._log_weight - self._log_weight.max())
        if weight.sum() ** 2 < 0.5 * PARTICLES * (weight @ weight):
            self._resample(weight)

    def _resample(self, weight: Floats) -> None:
        total = np.cumsum(weight)
        drawn = np.searchsorted(total, (np.arange(PARTICLES) + self._rng.random()) / PARTICLES * total[-1])
        self._state = self._state[np.minimum(drawn, PARTICLES - 1)]
        self._state[:, :2] += self._rng.normal(0.0, ROUGHEN_M, (PARTICLES, 2))
        self._log_weight = np.zeros(PARTICLES)

    @property
    def cloud(self) -> Cloud:
        """Where the vehicle may be now, as a normal that owns to what the cloud does not know."""
        weight = np.exp(self._log_weight - self._log_weight.max())
        weight /= weight.sum()
        mean = weight @ self._state[:, :2]
        off = self._state[:, :2] - mean
        covariance = WIDEN**2 * (weight[:, None] * off).T @ off + LEAST_SD_M**2 * np.eye(2)
        return Cloud(float(mean[0]), float(mean[1]), covariance)
