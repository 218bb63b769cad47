"""Whole logs, scan after scan: how much of them holds together, how true the pieces are, and what a scan costs."""

from __future__ import annotations

import time
from dataclasses import dataclass
from math import sqrt
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from config.schema import Map
from mapping.graph import seen_from
from mapping.prior import Hint
from mapping.stations import Stations
from mapping.values import Pose, Station
from tools.bench.align import align

if TYPE_CHECKING:
    from tools.bench.stations import Laser

WRONG_M: Final = 0.5
IN_95: Final = 5.99
HINT_M: Final = 0.5
LEAST: Final = 3
"""Fewer stations make no piece worth the name."""

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class LogFigures:
    """A whole log; ``in_pieces`` is the share of its stations that are in pieces of three or more.

    Errors are of those, after the best rigid alignment of each piece; ``covered`` is the share of their 95 % ellipses
    that hold the true place as seen from the piece's first station.  ``early_ms`` and ``late_ms`` are of the first and
    the last quarter of the scans, each with everything: processor time on this machine.
    """

    log: str
    hints: str
    stations: int
    in_map: int
    in_pieces: float
    pieces: int
    rmse_m: float
    error_max_m: float
    wrong: int
    covered: float
    early_ms: float
    late_ms: float


def whole(log: Laser, name: str, *, hinted: bool) -> LogFigures:
    """Place all scans of a log; with hints that are wrong by up to ``HINT_M`` east and north at each step."""
    stations, seconds = _placed(log, hinted=hinted)
    pieces: dict[int, list[int]] = {}
    for k, station in enumerate(stations):
        pieces.setdefault(station.piece, []).append(k)
    told = [members for members in pieces.values() if len(members) >= LEAST]
    error_m = np.concatenate([_errors_m(log, stations, members) for members in told] or [np.zeros(0)])
    inside = [held for members in told for held in _covered(log, stations, members)]
    quarter = max(1, len(seconds) // 4)
    return LogFigures(
        log=name,
        hints="+-0.5 m" if hinted else "none",
        stations=len(stations),
        in_map=len(pieces.get(0, [])),
        in_pieces=round(len(error_m) / len(stations), 3),
        pieces=len(pieces),
        rmse_m=round(sqrt(float(np.mean(error_m**2))) if len(error_m) else 0.0, 3),
        error_max_m=round(float(error_m.max(initial=0.0)), 3),
        wrong=int((error_m > WRONG_M).sum()),
        covered=round(float(np.mean(inside)), 3) if inside else 0.0,
        early_ms=round(1000.0 * float(np.mean(seconds[:quarter]))),
        late_ms=round(1000.0 * float(np.mean(seconds[-quarter:]))),
    )


def _placed(log: Laser, *, hinted: bool) -> tuple[tuple[Station, ...], list[float]]:
    """Add all scans one after the other; what each took, in seconds of the processor."""
    stations, rng, seconds = Stations(Map()), np.random.default_rng(1), []
    for i, sight in enumerate(log.sights):
        hint = None
        if hinted and i:
            dx, dy = log.true_m[i] - log.true_m[i - 1] + rng.uniform(-HINT_M, HINT_M, 2)
            hint = Hint(float(dx), float(dy), HINT_M)
        begun = time.process_time()
        stations.add(sight, hint)
        seconds.append(time.process_time() - begun)
    return stations.all, seconds


def _errors_m(log: Laser, stations: tuple[Station, ...], members: list[int]) -> Floats:
    found_m = np.array([[stations[k].pose.x_m, stations[k].pose.y_m] for k in members])
    off_m = align(found_m, log.true_m[members], 0.0).apply(found_m) - log.true_m[members]
    return np.hypot(off_m[:, 0], off_m[:, 1])


def _covered(log: Laser, stations: tuple[Station, ...], members: list[int]) -> list[bool]:
    """Tell of each station but the first whether its ellipse holds its true place, as seen from the first."""
    first, held = members[0], []
    true_first = _true(log, first)
    start = stations[first].pose
    cos, sin = np.cos(start.heading_rad), np.sin(start.heading_rad)
    turn = np.array([[cos, -sin], [sin, cos]])
    for k in members[1:]:
        seen, true = seen_from(start, stations[k].pose), seen_from(true_first, _true(log, k))
        off = np.array([seen.x_m - true.x_m, seen.y_m - true.y_m])
        covariance = turn @ stations[k].covariance[:2, :2] @ turn.T
        held.append(bool(off @ np.linalg.solve(covariance, off) <= IN_95))
    return held


def _true(log: Laser, k: int) -> Pose:
    return Pose(float(log.true_m[k, 0]), float(log.true_m[k, 1]), float(log.heading_rad[k]))
