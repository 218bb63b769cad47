from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from config.schema import Map
from mapping.chart import Charts
from mapping.graph import seen_from
from mapping.loops import Closing, around, closing
from mapping.pieces import Pieces, sd_m
from mapping.prior import Cloud, Prior
from mapping.sight import Sight
from mapping.values import Pose
from tests.mapping.rooms import KEYHOLE, Stay
from tests.mapping.test_pieces import BEAM, STAYS, sights_of, true, turned

ROUND = [*STAYS, Stay(0.5, -0.3, 0.9, 330), Stay(0.2, 0.5, 1.4, 330)]
DRIFT = np.array([0.6, -0.5])


@pytest.fixture(scope="module")
def sights() -> list[Sight]:
    return sights_of(KEYHOLE, ROUND)


def chain(sights: list[Sight], of: range, sd_m: float, onto: Pieces | None = None) -> Pieces:
    """A chain of stations, each found with ``sd_m``, that drifts as far as that allows."""
    pieces = onto or Pieces(math.radians(4.0), BEAM)
    pieces.begin(of[0], sights[of[0]], true(ROUND[of[0]]))
    for k in of[1:]:
        seen, base = seen_from(true(ROUND[k - 1]), true(ROUND[k])), pieces.pose(k - 1)
        x, y = np.array([base.x_m, base.y_m]) + turned(base.heading_rad, seen) + sd_m * DRIFT
        covariance = np.diag([sd_m**2, sd_m**2, math.radians(1.0) ** 2])
        pieces.grow(k, sights[k], k - 1, Pose(float(x), float(y), base.heading_rad + seen.heading_rad), covariance)
    return pieces


def off_m(found: Closing, pieces: Pieces) -> float:
    seen = seen_from(pieces.pose(found.one), found.pose)
    right = seen_from(true(ROUND[found.one]), true(ROUND[found.other]))
    return math.hypot(seen.x_m - right.x_m, seen.y_m - right.y_m)


def test_a_chain_that_comes_round_is_tied_to_where_it_began(sights: list[Sight]) -> None:
    pieces = chain(sights, range(5), 0.2)
    before = sd_m(pieces.solution(0).between(0, 4))
    found = closing(pieces, Charts(pieces, Map()), 4, Map())
    assert found is not None
    assert (found.one, found.other) == (0, 4)
    assert off_m(found, pieces) < 0.06
    pieces.close(found.one, found.other, found.pose, found.covariance)
    assert sd_m(pieces.solution(0).between(0, 4)) < min(0.15, before / 2.0)
    assert closing(pieces, Charts(pieces, Map()), 4, Map()) is None, "it is closed"


def test_neighbours_in_time_are_no_loop_and_a_sure_chain_needs_none(sights: list[Sight]) -> None:
    unsure = chain(sights, range(5), 0.2)
    assert closing(unsure, Charts(unsure, Map()), 2, Map()) is None
    sure = chain(sights, range(5), 0.01)
    assert closing(sure, Charts(sure, Map()), 4, Map()) is None


def test_a_chain_that_walls_deny_is_not_closed(sights: list[Sight]) -> None:
    pieces = chain([*sights[:4], replace(sights[3], scan=replace(sights[3].scan, index=4))], range(5), 0.2)
    assert closing(pieces, Charts(pieces, Map()), 4, Map()) is None


def test_a_piece_is_joined_where_it_comes_round_to_another(sights: list[Sight]) -> None:
    pieces = chain(sights, range(3), 0.02)
    chain(sights, range(3, 6), 0.02, pieces)
    at, drifted = true(ROUND[3]), 0.3
    cloud = Cloud(at.x_m + drifted, at.y_m, np.diag([0.5**2, 0.1**2]))
    prior = Prior(at.x_m, at.y_m, 3.5, at.heading_rad, 0.05, cloud=cloud)
    charts = Charts(pieces, Map())
    found = around(pieces, charts, (2, 3), 5, prior, Map())
    assert found is not None
    assert found.other == 5
    assert found.one in (0, 1)
    assert off_m(found, pieces) < 0.1
    lost = replace(prior, cloud=replace(cloud, covariance=np.diag([1.5**2, 0.1**2])))
    assert around(pieces, charts, (2, 3), 5, lost, Map()) is None
    elsewhere = replace(prior, cloud=replace(cloud, x_m=at.x_m + 40.0))
    assert around(pieces, charts, (2, 3), 5, elsewhere, Map()) is None
