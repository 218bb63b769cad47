from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from config.schema import Map
from mapping.course import MOST_MARKS, agreement, course_of
from mapping.echoes import pick
from mapping.path import HERE, THERE, improve, inertia
from mapping.prior import Cloud
from mapping.sight import Sight, sight_of
from mapping.traverse import (
    HEARD_TEMPER,
    HEARD_WIDEN,
    Settled,
    is_alone,
    joined,
    sobered,
    traverse,
)
from mapping.values import Way
from tests.mapping.rooms import KEYHOLE, TUNNEL, Stay, pings
from tests.mapping.test_scan_builder import build

START = Stay(0.3, -0.2, 0.4, 330)


def two_sights(walls: np.ndarray, there: Stay) -> tuple[Sight, Sight]:
    scans = build(list(pings(walls, [START, there], np.random.default_rng(3))))
    first, second = (sight_of(scan, pick(scan, Map()), Map()) for scan in scans)
    return first, second


def settled_at(x_m: float, y_m: float, height: float) -> Settled:
    path = np.zeros((6, 3))
    path[-1, :2] = x_m, y_m
    return Settled(path, np.diag([0.02**2, 0.005**2]), height)


def gone(pair: tuple[Sight, Sight]) -> Cloud:
    assert pair[1].scan.way is not None
    cloud = traverse(*pair, pair[1].scan.way, Map())
    assert cloud is not None
    return cloud


@pytest.fixture(scope="module")
def keyhole() -> tuple[Sight, Sight]:
    return two_sights(KEYHOLE, Stay(0.1, 1.6, 1.2, 330, glide=250))


@pytest.fixture(scope="module")
def tunnel() -> tuple[Sight, Sight]:
    return two_sights(TUNNEL, Stay(2.3, -0.1, 1.1, 330, glide=250))


def test_in_a_room_a_traverse_is_right_and_sure(keyhole: tuple[Sight, Sight]) -> None:
    cloud = gone(keyhole)
    off = np.array([cloud.x_m + 0.2, cloud.y_m - 1.8])
    assert np.hypot(*off) < 0.05
    assert cloud.sd_m < 0.15
    assert off @ np.linalg.solve(cloud.covariance, off) < 6.0


def test_along_a_smooth_tunnel_a_traverse_knows_that_it_does_not_know(tunnel: tuple[Sight, Sight]) -> None:
    cloud = gone(tunnel)
    assert math.sqrt(cloud.covariance[0, 0]) > 0.6
    assert math.sqrt(cloud.covariance[1, 1]) < 0.2
    off = np.array([cloud.x_m - 2.0, cloud.y_m - 0.1])
    assert off @ np.linalg.solve(cloud.covariance, off) < 6.0


def test_the_same_way_gives_the_same_traverse(keyhole: tuple[Sight, Sight]) -> None:
    one, two = gone(keyhole), gone(keyhole)
    assert (one.x_m, one.y_m, one.covariance.tobytes()) == (two.x_m, two.y_m, two.covariance.tobytes())


def test_a_way_with_a_pause_was_not_seen(keyhole: tuple[Sight, Sight]) -> None:
    way = keyhole[1].scan.way
    assert way is not None
    late = way.t_ns + np.where(np.arange(len(way.t_ns)) > 100, 20_000_000_000, 0)
    assert traverse(*keyhole, Way(late, way.direction_rad, way.echoes, way.bin_m, way.step_rad), Map()) is None


def test_a_way_to_another_depth_is_not_followed(keyhole: tuple[Sight, Sight]) -> None:
    here, there = keyhole
    assert there.scan.way is not None
    deeper = replace(there, scan=replace(there.scan, depth_m=2.0))
    assert traverse(here, deeper, there.scan.way, Map()) is None


def test_a_way_of_which_nothing_was_heard_leaves_the_rests_to_speak(keyhole: tuple[Sight, Sight]) -> None:
    way = keyhole[1].scan.way
    assert way is not None
    silent = Way(way.t_ns, way.direction_rad, np.zeros_like(way.echoes), way.bin_m, way.step_rad)
    cloud = traverse(*keyhole, silent, Map())
    assert cloud is not None
    off = np.array([cloud.x_m + 0.2, cloud.y_m - 1.8])
    assert off @ np.linalg.solve(cloud.covariance, off) < 9.0


def test_a_path_that_is_a_little_wrong_settles_where_the_vehicle_went(keyhole: tuple[Sight, Sight]) -> None:
    here, there = keyhole
    assert there.scan.way is not None
    course = course_of(here, there, there.scan.way, Map())
    assert set(course.marks.group) >= {HERE, THERE, 1, 2}
    assert course.when().min() == 0.0
    assert course.when().max() == 1.0
    path = np.zeros((course.knots + 2, 3))
    path[1:-1, :2] = np.linspace(0.0, 1.0, course.knots)[:, None] * [-0.1, 1.7]
    path[-1, :2] = (-0.1, 1.7)
    prior = inertia(course.seconds, course.knots, 0.0)
    settled = path
    for within_m in (0.3, 0.15):
        settled, information = improve(settled, course.marks.along(settled), prior, within_m, 3)
    assert np.hypot(*(settled[-1, :2] - [-0.2, 1.8])) < 0.04
    assert agreement(settled, course) > agreement(path, course) + 5.0
    assert np.linalg.eigvalsh(information[3:, 3:]).min() > 0.0
    assert np.all(settled[0] == 0.0)


def test_a_long_way_has_no_more_marks_than_can_be_settled(keyhole: tuple[Sight, Sight]) -> None:
    here, there = keyhole
    way = there.scan.way
    assert way is not None
    n = 4 * len(way.t_ns)
    long = Way(
        np.arange(n) * 20_000_000, np.resize(way.direction_rad, n), np.resize(way.echoes, (n, way.echoes.shape[1])),
        way.bin_m, way.step_rad,
    )  # fmt: skip
    short, course = course_of(here, there, way, Map()), course_of(here, there, long, Map())
    assert (short.marks.group > HERE).sum() < (course.marks.group > HERE).sum() <= MOST_MARKS
    assert np.isfinite(agreement(np.zeros((course.knots + 2, 3)), course))


def test_what_smooth_walls_seem_to_tell_along_them_is_taken_off() -> None:
    turn = np.array([[0.8, -0.6], [0.6, 0.8]])
    smooth, corner = (turn @ np.diag([along**2, 0.01**2]) @ turn.T for along in (0.08, 0.02))
    assert np.sqrt(np.linalg.eigvalsh(sobered(smooth))) == pytest.approx([0.01, 1.5])
    assert np.sqrt(np.linalg.eigvalsh(sobered(corner))) == pytest.approx([0.01, 0.02], rel=0.2)


def test_paths_that_end_near_the_best_one_are_no_rivals() -> None:
    best, near, far = (settled_at(*at) for at in ((0.0, 0.0, 100.0), (0.1, 0.2, 99.0), (1.0, 0.0, 40.0)))
    assert is_alone([best, near, far])
    assert not is_alone([best, near, replace(far, height=80.0)])
    assert is_alone([far])


def test_of_paths_that_fit_alike_the_one_along_which_walls_sound_alike_is_believed() -> None:
    short, right = (
        replace(settled_at(x, 0.0, height), like=like) for x, height, like in ((0.1, 110.0, 3.0), (2.4, 100.0, 19.0))
    )
    cloud = joined([short, right], HEARD_TEMPER, HEARD_WIDEN)
    assert cloud.x_m == pytest.approx(2.4, abs=0.01)
    assert cloud.sd_m < 0.1
    chance = joined([short, replace(right, like=4.0)], HEARD_TEMPER, HEARD_WIDEN)
    assert chance.sd_m > 0.5, "what sounds alike by chance tells nothing"
