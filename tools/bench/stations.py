"""Stations without odometry, on real laser logs made sonar-like: pairs of scans, and whole logs with and without hints.

The files of ``data/stations`` hold scans of 200 beams, a noisy compass and reference poses, which serve for scoring
only.  Their angles turn counter-clockwise from east.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from math import degrees, pi, radians
from pathlib import Path
from time import process_time
from typing import Final

import numpy as np
from numpy.typing import NDArray

from config.errors import DataError, UsageError
from config.schema import Map
from mapping.prior import Prior
from mapping.register import register
from mapping.sight import Sight, sight_of
from mapping.values import Returns, Scan
from mapping.verdict import judge
from tools.bench.align import angle_between
from tools.bench.long_dive import LongFigures, long_dive
from tools.bench.whole_logs import LogFigures, whole

REACH_M: Final = 3.0
NEAR_M, NEAR_DEG, WRONG_M = 0.15, 3.0, 0.5
IN_95: Final = 5.99

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class PairFigures:
    """Pairs of consecutive stations; shares of all pairs, but ``covered`` (by 95 % ellipses) of the accepted ones.

    ``placing_ms`` is the median processor time to make a scan ready and to register it, echoes not included.
    """

    log: str
    pairs: int
    near: float
    near_to_2_m: float
    accepted: float
    accepted_wrong: int
    covered: float
    placing_ms: float


@dataclass(frozen=True, slots=True)
class Laser:
    """A log: sights, true places ``(n, 2)`` in m, true headings and compass ``(n,)`` clockwise from north."""

    sights: list[Sight]
    true_m: Floats
    heading_rad: Floats
    chain: NDArray[np.int64]


def read(path: Path) -> Laser:
    """Read a log; raises DataError where it is something else."""
    try:
        return _laser(np.load(path, allow_pickle=False))
    except (KeyError, ValueError, IndexError) as error:
        raise DataError(f"{path} is no log of stations: {error}") from error


def _laser(log: Mapping[str, NDArray[np.float64]]) -> Laser:
    headings, compass = (pi / 2.0 - angle.astype(np.float64) for angle in (log["ref"][:, 2], log["compass"]))
    bearing = -log["bearing"].astype(np.float64)
    sights = [
        _sight(k, ranges.astype(np.float64), bearing, float(compass[k])) for k, ranges in enumerate(log["ranges360"])
    ]
    return Laser(sights, log["ref"][:, :2].astype(np.float64), headings, log["chain"].astype(np.int64))


def _sight(index: int, range_m: Floats, bearing_rad: Floats, heading_rad: float) -> Sight:
    seen = np.isfinite(range_m)
    returns = Returns(range_m, np.where(seen, 0.04, np.nan), np.where(seen, range_m, 0.0))
    echoes = np.zeros((len(range_m), 1), np.uint8)
    scan = Scan(index, index, index, heading_rad, float("nan"), bearing_rad, echoes, 0.02, radians(1.8), "full")
    return sight_of(scan, returns, Map())


def pairs(log: Laser, name: str) -> PairFigures:
    """Register each scan in the one before it, where both are within reach."""
    steps_m = np.hypot(*np.diff(log.true_m, axis=0).T)
    within = np.flatnonzero((np.diff(log.chain) == 0) & (steps_m <= REACH_M))
    rows = [(float(steps_m[i]), *_pair(log, int(i))) for i in within]
    step, off, turn_deg, accepted, covered, spent_s = (np.array(column) for column in zip(*rows, strict=True))
    near = (off <= NEAR_M) & (turn_deg <= NEAR_DEG)
    return PairFigures(
        log=name,
        pairs=len(rows),
        near=round(float(near.mean()), 3),
        near_to_2_m=round(float(near[step <= 2.0].mean()), 3),
        accepted=round(float(accepted.mean()), 3),
        accepted_wrong=int((off[accepted] > WRONG_M).sum()),
        covered=round(float(covered[accepted].mean()), 3),
        placing_ms=round(1e3 * float(np.median(spent_s)), 1),
    )


def _pair(log: Laser, i: int) -> tuple[float, float, bool, bool, float]:
    """Register a station in the one before: errors in m and degrees, whether accepted and covered, and seconds."""
    config, one, read_in = Map(), log.sights[i], log.sights[i + 1]
    begun_s = process_time()
    other = sight_of(read_in.scan, read_in.returns, config)
    turn_rad = other.scan.heading_rad - one.scan.heading_rad
    prior = Prior(0.0, 0.0, REACH_M, turn_rad, radians(config.compass_sd_deg))
    match = register(other.view, one.view, prior, config.particles, np.random.default_rng([config.seed, i]))
    spent_s = process_time() - begun_s
    off_m = np.array([match.pose.x_m, match.pose.y_m]) - _in_axes(log, i)
    turned = float(log.heading_rad[i + 1] - log.heading_rad[i])
    off_deg = degrees(abs(angle_between(match.pose.heading_rad, turned)))
    accepted = judge(other.scan, match, 0, prior, chained=True).status == "placed"
    return float(np.hypot(*off_m)), off_deg, accepted, _covered(match.covariance, off_m), spent_s


def _in_axes(log: Laser, i: int) -> Floats:
    """Where the next station is, in the axes of station ``i``: x right, y ahead."""
    (dx, dy), h = log.true_m[i + 1] - log.true_m[i], log.heading_rad[i]
    return np.array([np.cos(h) * dx - np.sin(h) * dy, np.sin(h) * dx + np.cos(h) * dy])


def _covered(covariance: Floats, off_m: Floats) -> bool:
    return bool(off_m @ np.linalg.solve(covariance[:2, :2], off_m) <= IN_95)


def measure(data: Path) -> Iterator[PairFigures | LogFigures | LongFigures]:
    """Yield the figures of all logs in a folder of recordings; raises UsageError where there is none."""
    logs = {path.stem: read(path) for path in sorted((data / "stations").glob("*.npz"))}
    if not logs:
        raise UsageError(f"no stations in {data / 'stations'}; name the folder of recordings with --data")
    for name, log in logs.items():
        yield pairs(log, name)
    for name, log in logs.items():
        for hinted in (False, True):
            yield whole(log, name, hinted=hinted)
    steady = min(logs, key=lambda name: int(logs[name].chain[-1]))
    yield long_dive(logs[steady], steady)
