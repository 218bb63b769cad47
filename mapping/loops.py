"""Loops: a scan whose piece leads round to where it began is held against what was seen there first.

Round a loop the errors of a chain add up, so the walls at its two ends are not compared as those of neighbours are.
Where registration there agrees with the chain, two paths lead to one place, and the tie is believed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from config.schema import Map
from mapping.chart import Charts
from mapping.compass import wrap
from mapping.graph import put_at, seen_from
from mapping.hypotheses import lies
from mapping.pieces import SURE_M, Pieces, sd_m
from mapping.prior import Cloud, Floats, Prior
from mapping.register import Match, register
from mapping.signs import MOST_BEHIND
from mapping.values import Pose
from mapping.verdict import ACCEPT, ACCEPT_SD_M, ASTRAY, LEAST_MARGIN

APART = 3
"""Scans so near to each other in time are on no two sides of a loop."""
NEAR_M = 3.0
"""A loop is closed where its ends are no farther apart than this ..."""
LOST_M = 1.0
"""... and lie to each other no less surely than this."""
HELD = 6
LEAST_TURN_RAD = 0.02


@dataclass(frozen=True, slots=True)
class Closing:
    """Station ``one`` is where a loop began, ``other`` where it ends, at ``pose`` in their piece."""

    one: int
    other: int
    pose: Pose
    covariance: Floats


def closing(pieces: Pieces, charts: Charts, other: int, config: Map) -> Closing | None:
    """Close the loop that a station of a piece may end; None where there is none, or where it is not sure."""
    began = _beginning(pieces, other)
    if not began:
        return None
    one = began[0]
    prior = _prior(pieces, one, other, config)
    sight = pieces.sight(other)
    reference = charts.reference(began, prior, sight)
    rng = np.random.default_rng([config.seed, sight.scan.index, one, 3])
    alone = None if len(began) == 1 else charts.alone(sight, one, prior)
    match = register(sight.view, reference, prior, config.particles, rng, alone)
    return Closing(one, other, match.pose, match.covariance) if is_sure(match) else None


def is_sure(match: Match) -> bool:
    """Tell whether walls at the beginning of a loop are the same as at its end, where the chain says that they are."""
    clear = match.margin >= LEAST_MARGIN and match.odds >= ACCEPT and match.behind <= MOST_BEHIND
    return clear and sd_m(match.covariance) <= ACCEPT_SD_M and match.astray <= ASTRAY


def _beginning(pieces: Pieces, other: int) -> list[int]:
    """Name the stations where a loop began that ends at one, the nearest first; none where its chain tells enough."""
    solution, at = pieces.solution(other), pieces.pose(other)
    far = {k: float(np.hypot(pieces.pose(k).x_m - at.x_m, pieces.pose(k).y_m - at.y_m)) for k in solution.stations}
    away = [k for k in solution.stations if abs(k - other) > APART and far[k] <= NEAR_M]
    unsure = [k for k in away if SURE_M < sd_m(solution.between(k, other)) <= LOST_M]
    if not unsure or len(unsure) < len(away):
        return []  # what holds one of them holds the loop
    unsure.sort(key=lambda k: (far[k], k))
    return [k for k in unsure if k == unsure[0] or sd_m(solution.between(unsure[0], k)) <= SURE_M][:HELD]


def _prior(pieces: Pieces, one: int, other: int, config: Map) -> Prior:
    """Say where the chain leads, as surely as it does."""
    solution, base, at = pieces.solution(one), pieces.pose(one), pieces.pose(other)
    between = solution.between(one, other)
    c, s = np.cos(base.heading_rad), np.sin(base.heading_rad)
    turn = np.array([[c, s], [-s, c]])
    cloud = Cloud(at.x_m, at.y_m, turn @ between[:2, :2] @ turn.T)
    turned_rad = max(float(np.sqrt(between[2, 2])), LEAST_TURN_RAD)
    return Prior(at.x_m, at.y_m, config.reach_m, wrap(at.heading_rad), turned_rad, cloud=cloud)


def around(
    pieces: Pieces, charts: Charts, ends: tuple[int, int], other: int, prior: Prior, config: Map
) -> Closing | None:
    """Join a piece to another where one of its stations has come round to it; None where it has not, or not surely.

    ``ends`` are the last station of the one piece and the first of the other, and ``prior`` says where the way between
    them led: too far about to tell how the pieces lie, but not where the loop ends.
    """
    last, first = ends
    if prior.cloud is None or prior.cloud.sd_m > LOST_M:
        return None
    seen = seen_from(pieces.pose(first), pieces.pose(other))
    there = put_at(Pose(prior.cloud.x_m, prior.cloud.y_m, prior.heading_rad), seen)
    far = {k: float(np.hypot(pieces.pose(k).x_m - there.x_m, pieces.pose(k).y_m - there.y_m)) for k in pieces.of(last)}
    near = sorted((far[k], k) for k in far if abs(k - other) > APART and far[k] <= NEAR_M)
    if not near:
        return None
    own = pieces.solution(first).between(first, other)[:2, :2]
    swing = (prior.heading_sd_rad * float(np.hypot(seen.x_m, seen.y_m))) ** 2 + float(np.linalg.eigvalsh(own)[-1])
    led = Cloud(there.x_m, there.y_m, prior.cloud.covariance + swing * np.eye(2))
    about = Prior(there.x_m, there.y_m, config.reach_m, there.heading_rad, prior.heading_sd_rad, cloud=led)
    one = near[0][1]
    rng = np.random.default_rng([config.seed, pieces.sight(other).scan.index, one, 4])
    fit = lies(pieces, charts, (one, other), about, config.particles // 2, rng)
    astray = about.astray(np.array([fit.pose.x_m, fit.pose.y_m, fit.pose.heading_rad]))
    return Closing(one, other, fit.pose, fit.covariance) if fit.is_sure and astray <= ASTRAY else None
