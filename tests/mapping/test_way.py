from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from config.schema import Map
from mapping.echoes import pick
from mapping.prior import Cloud, Hint, Prior, agreed
from mapping.sight import sight_of
from mapping.values import Pose, Scan
from mapping.way import Walk
from tests.mapping.rooms import KEYHOLE, TUNNEL, Stay, pings
from tests.mapping.test_scan_builder import build


def two_scans(walls: np.ndarray, there: Stay) -> tuple[Scan, Scan]:
    stays = [Stay(0.3, -0.2, 0.4, 330), there]
    first, second = build(list(pings(walls, stays, np.random.default_rng(3))))
    return first, second


def followed(first: Scan, second: Scan) -> Cloud:
    assert second.way is not None
    sight = sight_of(first, pick(first, Map()), Map())
    start = Pose(0.0, 0.0, 0.0)  # of the first scan's own axes: its field is not turned
    walk = Walk(start, first.heading_rad, sight.view.field, np.random.default_rng(1))
    assert walk.follow(second.way, Map())
    return walk.cloud


@pytest.fixture(scope="module")
def keyhole() -> tuple[Scan, Scan]:
    return two_scans(KEYHOLE, Stay(0.1, 1.6, 1.2, 330, glide=250))


def moved(there: Stay) -> np.ndarray:
    """The way in axes that turn with the first scan."""
    dx, dy, h = there.x_m - 0.3, there.y_m + 0.2, 0.4
    return np.array([math.cos(h) * dx - math.sin(h) * dy, math.sin(h) * dx + math.cos(h) * dy])


def test_scans_hold_the_pings_of_the_way_between_them(keyhole: tuple[Scan, Scan]) -> None:
    first, second = keyhole
    assert first.way is None
    way = second.way
    assert way is not None
    assert first.t_end_ns < way.t_ns[0]
    assert way.t_ns[-1] < second.t_start_ns
    assert np.all(np.diff(way.t_ns) > 0)
    assert len(way.t_ns) == len(way.echoes) == len(way.direction_rad) > 250
    back = way.back()
    assert np.all(np.diff(back.t_ns) > 0)
    np.testing.assert_array_equal(back.echoes[0], way.echoes[-1])


def test_a_cloud_follows_the_vehicle_through_a_room(keyhole: tuple[Scan, Scan]) -> None:
    cloud = followed(*keyhole)
    off = np.array([cloud.x_m, cloud.y_m]) - moved(Stay(0.1, 1.6, 1.2, 0))
    assert np.hypot(*off) < 0.6
    assert off @ np.linalg.solve(cloud.covariance, off) < 9.0


def test_the_same_way_gives_the_same_cloud(keyhole: tuple[Scan, Scan]) -> None:
    one, two = followed(*keyhole), followed(*keyhole)
    assert (one.x_m, one.y_m) == (two.x_m, two.y_m)


def test_along_a_smooth_tunnel_a_cloud_knows_that_it_does_not_know() -> None:
    first, _ = two_scans(KEYHOLE, Stay(0.1, 1.6, 1.2, 330, glide=250))
    tunnel = list(pings(TUNNEL, [Stay(0.0, 0.0, 0.0, 330)], np.random.default_rng(3)))
    (here,) = build(tunnel)
    assert here.way is None
    assert first.way is None
    way = two_scans(KEYHOLE, Stay(0.1, 1.6, 1.2, 330, glide=250))[1].way
    assert way is not None
    along = replace(
        way, echoes=np.resize(here.echoes, way.echoes.shape), direction_rad=np.resize(here.bearing_rad, len(way.t_ns))
    )
    sight = sight_of(here, pick(here, Map()), Map())
    walk = Walk(Pose(0.0, 0.0, 0.0), 0.0, sight.view.field, np.random.default_rng(1))
    assert walk.follow(along, Map())
    value, vector = np.linalg.eigh(walk.cloud.covariance)
    assert math.sqrt(value[1]) > 1.0
    assert abs(vector[0, 1]) > 0.9


def test_a_way_with_a_pause_was_not_seen(keyhole: tuple[Scan, Scan]) -> None:
    first, second = keyhole
    assert second.way is not None
    late = second.way.t_ns + np.where(np.arange(len(second.way.t_ns)) > 100, 20_000_000_000, 0)
    sight = sight_of(first, pick(first, Map()), Map())
    walk = Walk(Pose(0.0, 0.0, 0.0), 0.0, sight.view.field, np.random.default_rng(1))
    assert not walk.follow(replace(second.way, t_ns=late), Map())


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
