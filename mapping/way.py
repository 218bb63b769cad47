"""The way between two scans: where each beam that was sent under way saw the wall.

Beams are picked as they are at rest, in goes of less than a turn: meanwhile the vehicle moves, but the line of walls
only bends a little for it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from config.schema import Map
from mapping.echoes import pick
from mapping.values import Returns, Scan, Way
from mapping.view import TRUSTED_SD_M, VAGUE_SD_M

GO_RAD = math.radians(200.0)
"""Beams within this are picked together ..."""
BESIDE_RAD = math.radians(60.0)
"""... with their neighbours on either side: less than a turn, so that its end does not meet its beginning."""
LEG_BEAMS = 5
"""Beams by which the head is seen to turn round: the vehicle's heading trembles."""
FEW_BEAMS = 20

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
