from __future__ import annotations

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from config.schema import Map
from mapping.graph import put_at
from mapping.likelihood import PLAIN, ROUGH, Likelihood, said
from mapping.modes import Mode, is_elsewhere, mode_at
from mapping.prior import Prior
from mapping.register import MODES, Match, challenged, modes_of, register
from mapping.sight import Sight, sight_of
from mapping.signs import MOST, SIGNS, behind, odds_of, signs_of
from mapping.values import Pose, Returns, Scan
from mapping.verdict import ACCEPT, judge
from mapping.view import LEVEL_M, LEVELS
from tests.mapping.rooms import KEYHOLE, RECTANGLE, STEP_RAD, TUNNEL, cast

BEARING = np.arange(200.0) * STEP_RAD
CONFIG = Map()


def seen(walls: NDArray[np.float64], x_m: float, y_m: float, heading_rad: float, seed: int = 1) -> Sight:
    """Make a scan as a sonar of 8 m range sees it, with 3 cm of noise and a tenth of its beams silent."""
    rng = np.random.default_rng(seed)
    range_m = np.array([cast(walls, x_m, y_m, heading_rad + float(b))[0] for b in BEARING]) + rng.normal(0.0, 0.03, 200)
    range_m[(range_m > 8.0) | (rng.random(200) < 0.1)] = np.nan
    returns = Returns(range_m, np.where(np.isfinite(range_m), 0.03, np.nan), np.nan_to_num(range_m))
    scan = Scan(0, 0, 0, heading_rad, math.nan, BEARING, np.zeros((200, 1), np.uint8), 0.02, STEP_RAD, "full")
    return sight_of(scan, returns, CONFIG)


def matched(scan: Sight, reference: Sight, reach_m: float = 3.0, particles: int = 1000) -> Match:
    turn_rad = scan.scan.heading_rad - reference.scan.heading_rad + math.radians(3.0)
    prior = Prior(0.0, 0.0, reach_m, turn_rad, math.radians(4.0))
    return register(scan.view, reference.view, prior, particles, np.random.default_rng(4))


@given(x_m=st.floats(-1.2, 1.2), y_m=st.floats(-1.5, 0.5), turn_rad=st.floats(-0.6, 0.6))
@settings(max_examples=6, deadline=None)
def test_a_scan_is_found_where_it_was_made(x_m: float, y_m: float, turn_rad: float) -> None:
    match = matched(seen(KEYHOLE, x_m, y_m, turn_rad, seed=2), seen(KEYHOLE, 0.2, -0.5, 0.0))
    off = np.array([match.pose.x_m - x_m + 0.2, match.pose.y_m - y_m - 0.5])
    assert math.hypot(*off) < 0.06
    assert off @ np.linalg.solve(match.covariance[:2, :2], off) < 14.0
    assert not match.ridge


def test_a_reference_in_axes_of_its_own_says_the_same_of_poses_of_the_map() -> None:
    scan, reference = seen(KEYHOLE, 0.5, 0.3, 0.2, seed=2), seen(KEYHOLE, 0.2, -0.5, 0.0)
    at, prior = Pose(7.0, -3.0, 0.9), Prior(0.0, 0.0, 50.0, 0.0, math.inf)
    seen_poses = [Pose(0.3, 0.8, 0.2), Pose(-0.4, 1.1, 0.3), Pose(2.0, 0.1, -0.2)]
    of_map = [put_at(at, pose) for pose in seen_poses]
    inside, outside = (
        Likelihood(scan.view, reference.view, prior, where).score(
            np.array([[pose.x_m, pose.y_m, pose.heading_rad] for pose in poses])
        )
        for where, poses in ((None, seen_poses), (at, of_map))
    )
    assert outside == pytest.approx(inside, abs=0.01)
    assert inside[0] > inside[2] + 0.3


def test_a_tunnel_is_one_long_mode_that_covers_the_truth() -> None:
    match = matched(seen(TUNNEL, 1.2, -0.1, 0.3, seed=2), seen(TUNNEL, 0.0, 0.1, 0.2))
    assert match.ridge
    c, s = math.cos(0.2), math.sin(0.2)
    off = np.array([match.pose.x_m - (c * 1.2 + s * 0.2), match.pose.y_m - (s * 1.2 - c * 0.2)])
    assert off @ np.linalg.solve(match.covariance[:2, :2], off) < 6.0
    sds = np.sqrt(np.linalg.eigvalsh(match.covariance[:2, :2]))
    assert sds[0] < 0.06
    assert sds[1] > 0.5
    assert math.degrees(abs(match.weak_rad - (math.pi / 2.0 - 0.2))) < 6.0


def test_of_two_answers_the_other_is_told_too() -> None:
    """A rectangle turned by half a circle is itself: without a compass there are two places."""
    prior = Prior(1.5, -0.25, 3.0, math.pi / 2.0, math.pi / 2.0)
    here, there = seen(RECTANGLE, 0.0, -0.5, 0.0), seen(RECTANGLE, 2.6, -1.0, 0.0, seed=2)
    match = register(there.view, here.view, prior, 2000, np.random.default_rng(4))
    assert match.margin < 6.0
    apart = abs(match.pose.heading_rad - match.other.heading_rad)
    assert math.degrees(abs(apart - math.pi)) < 10.0
    assert judge(there.scan, match, 0, prior, chained=True).status != "placed"


def test_the_same_seed_gives_the_same_bytes() -> None:
    one, other = (matched(seen(KEYHOLE, 0.5, 0.3, 0.2, seed=2), seen(KEYHOLE, 0.0, 0.0, 0.0)) for _ in range(2))
    assert one.pose == other.pose
    assert one.covariance.tobytes() == other.covariance.tobytes()


@pytest.mark.parametrize("particles", [50, 200])
def test_few_particles_are_enough_where_the_prior_is_small(particles: int) -> None:
    match = matched(seen(KEYHOLE, 0.3, 0.2, 0.1, seed=2), seen(KEYHOLE, 0.0, 0.0, 0.0), 0.5, particles)
    assert math.hypot(match.pose.x_m - 0.3, match.pose.y_m - 0.2) < 0.06


def test_walls_speak_for_a_pose_and_open_water_against_it() -> None:
    here = seen(KEYHOLE, 0.0, 0.0, 0.0)
    like = Likelihood(here.view, here.view, Prior(0.0, 0.0, 3.0, 0.0, 1.0))
    poses = np.array([[0.0, 0.0, 0.0], [0.3, 0.3, 0.0], [0.0, 0.0, 0.3], [40.0, 0.0, 0.0]])
    scores = like.score(poses)
    assert scores[0] > 0.3
    assert scores[1:3].max() < 0.5 * scores[0]
    assert scores[3] == pytest.approx(0.0, abs=0.01)  # nothing in common: neither for nor against


@pytest.mark.parametrize("kind", [ROUGH, PLAIN])
@pytest.mark.parametrize("sigma_m", [0.08, 0.2, 0.4])
def test_what_a_point_says_falls_off_from_the_wall_into_the_water(kind: int, sigma_m: float) -> None:
    table = said(kind, sigma_m).reshape(-1)
    dry, wet = table[:LEVELS], table[LEVELS : 2 * LEVELS]
    assert (np.diff(dry) <= 1e-6).all()
    assert (wet <= dry + 1e-6).all()
    assert wet[0] > 0.0 > wet[int(0.4 / LEVEL_M)] or kind == ROUGH


def test_the_right_place_is_likelier_right_than_any_other() -> None:
    scan, reference = seen(KEYHOLE, 0.3, 0.2, 0.1, seed=2), seen(KEYHOLE, 0.0, 0.0, 0.0)
    prior = Prior(0.0, 0.0, 3.0, 0.1, math.radians(4.0))
    like = Likelihood(scan.view, reference.view, prior)
    modes = modes_of(like, prior, 600, np.random.default_rng(4))
    assert len(modes) == MODES
    assert [mode.height for mode in modes] == sorted((mode.height for mode in modes), reverse=True)
    assert all(is_elsewhere(one.pose, other.pose) for one, other in itertools.combinations(modes, 2))
    odds = odds_of(signs_of(scan.view, reference.view, like, prior, modes, None))
    right = [math.hypot(mode.pose[0] - 0.3, mode.pose[1] - 0.2) < 0.1 for mode in modes]
    assert right.count(True) == 1
    assert odds[right.index(True)] > max(ACCEPT, odds[np.logical_not(right)].max() + 4.0)


def test_signs_of_a_mode_are_its_own_and_against_the_best_one_elsewhere() -> None:
    scan, reference = seen(KEYHOLE, 0.3, 0.2, 0.1, seed=2), seen(KEYHOLE, 0.0, 0.0, 0.0)
    prior = Prior(0.0, 0.0, 3.0, 0.1, math.radians(4.0))
    like = Likelihood(scan.view, reference.view, prior)
    modes = [mode_at(like, np.array([x_m, 0.2, 0.1])) for x_m in (0.3, 1.5, 2.5)]
    modes.sort(key=lambda mode: -mode.height)
    signs = signs_of(scan.view, reference.view, like, prior, modes, None)
    told = dict(zip(SIGNS, signs.T, strict=True))
    assert signs.shape == (3, len(SIGNS))
    assert told["lead"] == pytest.approx([min(each, MOST) for each in leads(modes)])
    assert told["forth"] + told["back"] == pytest.approx(like.witnesses * told["fit"], rel=1e-4)
    ahead = told["plain on plain"][0] - told["plain on plain"][1]
    assert told["plain on plain, lead"][:2] == pytest.approx([ahead, -ahead])
    lone = signs_of(scan.view, reference.view, like, prior, modes[:1], None)[0]
    assert lone[SIGNS.index("lead")] == MOST


def leads(modes: list[Mode]) -> list[float]:
    heights = [mode.height for mode in modes]
    return [heights[0] - heights[1], heights[1] - heights[0], heights[2] - heights[0]]


def test_a_match_is_less_sure_where_another_prior_finds_as_good_a_place() -> None:
    match = matched(seen(KEYHOLE, 0.3, 0.2, 0.1, seed=2), seen(KEYHOLE, 0.0, 0.0, 0.0))
    near, far = challenged(match, match.height - 2.0), challenged(match, match.height - 1e3)
    assert near.margin == pytest.approx(2.0)
    assert far.margin == match.margin
    assert near.odds < far.odds == match.odds


def test_a_wall_seen_from_its_other_side_is_told_from_the_same_wall() -> None:
    reference = seen(RECTANGLE, 1.0, 0.0, 0.0)
    inside = seen(RECTANGLE, 1.4, 0.2, 0.0, seed=2)
    assert behind(inside.view, reference.view, np.array([0.4, 0.2, 0.0])) < 0.02
    beyond = np.array([7.4, 0.2, 0.0])  # its west wall on the reference's east wall, seen from the outside
    assert behind(inside.view, reference.view, beyond) > 0.05


def test_a_scan_that_fits_best_where_the_one_before_was_made_needs_more() -> None:
    scan = seen(KEYHOLE, 0.3, 0.2, 0.1, seed=2)
    match = replace(matched(scan, seen(KEYHOLE, 0.0, 0.0, 0.0)), odds=4.0)
    here, there = (Prior(x_m, 0.0, 3.0, 0.1, 0.1) for x_m in (0.0, -1.5))
    assert judge(scan.scan, match, 0, here, chained=True).status == "doubtful"
    assert judge(scan.scan, match, 0, there, chained=True).status == "placed"


def test_no_odds_place_a_scan_that_would_have_seen_walls_from_behind() -> None:
    scan = seen(KEYHOLE, 0.3, 0.2, 0.1, seed=2)
    match = replace(matched(scan, seen(KEYHOLE, 0.0, 0.0, 0.0)), odds=9.0)
    way = Prior(-1.5, 0.0, 3.0, 0.1, 0.1)
    assert judge(scan.scan, match, 0, way, chained=True).status == "placed"
    station = judge(scan.scan, replace(match, behind=0.25), 0, way, chained=True)
    assert (station.status, station.piece) == ("doubtful", scan.scan.index + 1)
    assert "from behind" in station.why


def test_a_scan_of_few_points_says_little() -> None:
    whole = seen(KEYHOLE, 0.3, 0.2, 0.0, seed=2)
    heard = np.arange(200) < 60
    range_m, free_m = (
        np.where(heard, told, none) for told, none in ((whole.returns.range_m, np.nan), (whole.returns.free_m, 0.0))
    )
    part = sight_of(whole.scan, replace(whole.returns, range_m=range_m, free_m=free_m), CONFIG)
    full, third = (matched(each, seen(KEYHOLE, 0.0, 0.0, 0.0)) for each in (whole, part))
    assert third.height < full.height
    assert third.odds < full.odds
