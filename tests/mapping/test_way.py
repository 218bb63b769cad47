from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from config.schema import Map
from mapping.echoes import pick
from mapping.prior import Cloud, Hint, Prior, agreed
from mapping.sight import Sight, sight_of
from mapping.strides import Strides
from mapping.values import Pose, Scan
from mapping.way import ranges_of
from tests.mapping.rooms import KEYHOLE, Stay, cast, pings
from tests.mapping.test_scan_builder import build

STAYS = [Stay(0.3, -0.2, 0.4, 330), Stay(0.1, 1.6, 1.2, 330, glide=250), Stay(0.0, -0.9, 0.6, 330, glide=250)]
START_PINGS = 330


@pytest.fixture(scope="module")
def keyhole() -> list[Scan]:
    return build(list(pings(KEYHOLE, STAYS, np.random.default_rng(3))))


@pytest.fixture(scope="module")
def sights(keyhole: list[Scan]) -> list[Sight]:
    return [sight_of(scan, pick(scan, Map()), Map()) for scan in keyhole]


def test_scans_hold_the_pings_of_the_way_between_them(keyhole: list[Scan]) -> None:
    first, second, _ = keyhole
    assert first.way is None
    way = second.way
    assert way is not None
    assert first.t_end_ns < way.t_ns[0]
    assert way.t_ns[-1] < second.t_start_ns
    assert np.all(np.diff(way.t_ns) > 0)
    assert len(way.t_ns) == len(way.echoes) == len(way.direction_rad) > 250


def test_beams_under_way_see_the_walls_where_they_are(keyhole: list[Scan]) -> None:
    way = keyhole[1].way
    assert way is not None
    range_m, trust = ranges_of(way, Map())
    gone = np.clip((way.t_ns / 50_000_000 - START_PINGS + 1) / 250, 0.0, 1.0)
    here, there = STAYS[:2]
    true_m = np.array(
        [
            cast(KEYHOLE, here.x_m + g * (there.x_m - here.x_m), here.y_m + g * (there.y_m - here.y_m), d)[0]
            for g, d in zip(gone, way.direction_rad, strict=True)
        ]
    )
    heard = np.isfinite(range_m)
    assert heard.mean() > 0.6
    assert np.array_equal(heard, trust > 0.0)
    off_m = np.abs(range_m - true_m)[heard]
    assert np.median(off_m) < 0.03
    assert np.mean(off_m > 0.3) < 0.05


def test_a_head_that_turns_to_and_fro_is_picked_leg_by_leg(keyhole: list[Scan]) -> None:
    way = keyhole[1].way
    assert way is not None
    there = np.arange(60)
    order = np.concatenate([there, there[::-1], there])
    swept = replace(way, t_ns=np.arange(180) * 50_000_000, direction_rad=way.direction_rad[order])
    swept = replace(swept, echoes=way.echoes[order])
    range_m, _ = ranges_of(swept, Map())
    forth, back, again = range_m[:60], range_m[60:120][::-1], range_m[120:]
    both = np.isfinite(forth) & np.isfinite(back) & np.isfinite(again)
    assert both.mean() > 0.5
    np.testing.assert_allclose(forth[both], again[both], atol=0.05)
    np.testing.assert_allclose(forth[both], back[both], atol=0.05)


def test_ways_lead_there_and_back_and_turn_with_the_map(sights: list[Sight]) -> None:
    strides = Strides(Map())
    start = Pose(5.0, 7.0, 0.4)
    there = strides.cloud(sights, 0, 1, start)
    assert there is not None
    assert (there.x_m, there.y_m) == pytest.approx((4.8, 8.8), abs=0.06)
    back = strides.cloud(sights, 1, 0, Pose(4.8, 8.8, 1.2))
    assert back is not None
    assert (back.x_m, back.y_m) == pytest.approx((5.0, 7.0), abs=0.08)
    turned = strides.cloud(sights, 0, 1, Pose(5.0, 7.0, 0.4 + math.pi / 2.0))
    assert turned is not None
    assert (turned.x_m, turned.y_m) == pytest.approx((6.8, 7.2), abs=0.06)
    assert turned.covariance[0, 0] == pytest.approx(there.covariance[1, 1], rel=0.05)


def test_ways_are_joined_as_long_as_all_were_seen(sights: list[Sight]) -> None:
    strides = Strides(Map())
    far = strides.cloud(sights, 0, 2, Pose(0.3, -0.2, 0.4))
    assert far is not None
    assert (far.x_m, far.y_m) == pytest.approx((0.0, -0.9), abs=0.1)
    one = strides.cloud(sights, 0, 1, Pose(0.3, -0.2, 0.4))
    assert one is not None
    assert far.sd_m > one.sd_m
    unseen = [sights[0], replace(sights[1], scan=replace(sights[1].scan, way=None)), sights[2]]
    assert Strides(Map()).cloud(unseen, 0, 2, Pose(0.3, -0.2, 0.4)) is None


def test_a_prior_is_led_by_a_way_that_is_surer_than_a_pilot() -> None:
    prior = Prior(0.0, 0.0, 3.0, 0.0, 0.07)
    assert not prior.is_led
    sure, unsure = Cloud(1.0, 0.0, 0.01 * np.eye(2)), Cloud(1.0, 0.0, np.diag([0.01, 1.0]))
    assert replace(prior, cloud=sure).led_to == sure
    assert not replace(prior, cloud=unsure).is_led
    assert replace(prior, cloud=sure).astray(np.array([1.3, 0.0, 0.0])) == pytest.approx(3.0)


def test_pilot_and_cloud_agree_or_the_pilot_is_believed() -> None:
    prior = Hint(2.0, 0.0, 0.5).prior(0.0, 0.0, 0.0, 0.07)
    near = agreed(prior, Cloud(1.0, 0.0, 0.25 * np.eye(2))).cloud
    assert near is not None
    assert near.x_m == pytest.approx(1.5)
    assert near.covariance[0, 0] == pytest.approx(0.125)
    assert agreed(prior, Cloud(-3.0, 0.0, 0.01 * np.eye(2))).cloud is None


def test_a_prior_with_a_cloud_still_owns_to_the_disc() -> None:
    prior = Prior(0.0, 0.0, 3.0, 0.0, 0.07, cloud=Cloud(1.0, 0.0, 0.04 * np.eye(2)))
    here, there, beyond = prior.log_density(np.array([[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [9.0, 0.0, 0.0]]))
    assert here > there + 5.0
    assert there > -10.0 > beyond
    drawn = prior.draw(1000, np.random.default_rng(1))
    assert 0.4 < np.mean(np.hypot(drawn[:, 0] - 1.0, drawn[:, 1]) < 0.6) < 0.7
