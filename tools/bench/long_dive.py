"""A long dive, up and down one log: what a scan costs early and late, with everything that follows from it."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final

import numpy as np

from config.schema import Map
from mapping.sight import sight_of
from mapping.stations import Stations

if TYPE_CHECKING:
    from tools.bench.stations import Laser

EARLY: Final = 20
LATE: Final = 200
MEAN_OF: Final = 10
"""So many scans, up to the one that a figure is of."""


@dataclass(frozen=True, slots=True)
class LongFigures:
    """Processor time of one scan, made ready, placed and drawn with the whole map, echoes not included."""

    log: str
    early: int
    early_ms: float
    late: int
    late_ms: float


def long_dive(log: Laser, name: str, late: int = LATE) -> LongFigures:
    """Go up and down a log until ``late`` scans are placed."""
    config = Map()
    stations, seconds = Stations(config), []
    for index in range(late):
        read_in = log.sights[_there_and_back(index, len(log.sights))]
        begun_s = time.process_time()
        sight = sight_of(replace(read_in.scan, index=index), read_in.returns, config)
        stations.add(sight, None)
        stations.grid()
        seconds.append(time.process_time() - begun_s)
    early_ms, late_ms = (1e3 * float(np.mean(seconds[max(0, k - MEAN_OF) : k])) for k in (EARLY, late))
    return LongFigures(name, EARLY, round(early_ms), late, round(late_ms))


def _there_and_back(index: int, scans: int) -> int:
    """Give the number of the scan that is met at a step of a walk up and down."""
    turn = index % max(2 * (scans - 1), 1)
    return min(turn, 2 * (scans - 1) - turn)
