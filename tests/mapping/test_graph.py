from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mapping.graph import Compass, Tie, derived, parts, put_at, seen_from, solve
from mapping.values import Pose

SURE = np.diag([1.0 / 0.05**2, 1.0 / 0.05**2, 1.0 / math.radians(0.5) ** 2])
poses = st.builds(Pose, st.floats(-20, 20), st.floats(-20, 20), st.floats(0, 6.28))


def ring(n: int) -> list[Pose]:
    """Places on a circle of 10 m, the first at the origin."""
    turn = np.arange(n) * 2.0 * math.pi / n
    return [Pose(10.0 * math.sin(t), 10.0 - 10.0 * math.cos(t), t) for t in turn]


def chain(places: list[Pose], rng: np.random.Generator) -> list[Tie]:
    noise = rng.normal(0.0, 1.0, (len(places), 3)) * [0.05, 0.05, math.radians(0.5)]
    seen = [seen_from(a, b) for a, b in pairwise(places)]
    moved = [Pose(p.x_m + e[0], p.y_m + e[1], p.heading_rad + e[2]) for p, e in zip(seen, noise, strict=False)]
    return [Tie(k, k + 1, pose, SURE) for k, pose in enumerate(moved)]


def started(ties: list[Tie]) -> dict[int, Pose]:
    """Poses along the chain."""
    found = {0: Pose(0.0, 0.0, 0.0)}
    for tie in ties:
        if tie.other == tie.one + 1:
            found[tie.other] = put_at(found[tie.one], tie.pose)
    return found


def north(places: list[Pose], sd_rad: float = math.radians(30.0)) -> Compass:
    return Compass({k: p.heading_rad for k, p in enumerate(places)}, sd_rad)


@given(poses, poses)
@settings(max_examples=50, deadline=None)
def test_a_pose_seen_from_another_is_put_back_where_it_was(one: Pose, other: Pose) -> None:
    back = put_at(one, seen_from(one, other))
    assert (back.x_m, back.y_m) == pytest.approx((other.x_m, other.y_m), abs=1e-9)
    assert math.cos(back.heading_rad - other.heading_rad) == pytest.approx(1.0)


@given(poses, poses)
@settings(max_examples=30, deadline=None)
def test_derivatives_are_those_of_the_differences(one: Pose, other: Pose) -> None:
    seen = seen_from(one, other)
    by_one, by_other = derived(seen, one)
    step = 1e-6
    for axis in range(3):
        by = [step if axis == k else 0.0 for k in range(3)]
        moved_one = seen_from(Pose(one.x_m + by[0], one.y_m + by[1], one.heading_rad + by[2]), other)
        moved_other = seen_from(one, Pose(other.x_m + by[0], other.y_m + by[1], other.heading_rad + by[2]))
        for moved, column in ((moved_one, by_one[:, axis]), (moved_other, by_other[:, axis])):
            off = np.array([moved.x_m - seen.x_m, moved.y_m - seen.y_m, moved.heading_rad - seen.heading_rad])
            assert off / step == pytest.approx(column, abs=1e-3)


def test_uncertainty_grows_along_a_chain_and_shrinks_where_a_loop_closes() -> None:
    places = ring(16)
    ties = chain(places, np.random.default_rng(1))
    compass = north(places)
    open_sd = [math.sqrt(np.trace(solve(started(ties), ties, compass).of(k)[:2, :2])) for k in range(16)]
    assert open_sd[0] == 0.0
    assert all(later > earlier for earlier, later in pairwise(open_sd[:9]))
    closed = solve(started(ties), [*ties, Tie(15, 0, seen_from(places[15], places[0]), SURE)], compass)
    assert math.sqrt(np.trace(closed.of(15)[:2, :2])) < 0.5 * open_sd[15]


def test_stated_errors_are_those_that_come() -> None:
    places, squared = ring(12), []
    for seed in range(120):
        ties = chain(places, np.random.default_rng(seed))
        solved = solve(started(ties), ties, north(places, sd_rad=10.0))
        off = np.array([solved.poses[11].x_m - places[11].x_m, solved.poses[11].y_m - places[11].y_m])
        squared.append(float(off @ np.linalg.solve(solved.of(11)[:2, :2], off)))
    assert np.mean(squared) == pytest.approx(2.0, rel=0.3)


def test_a_wrong_loop_is_let_go_where_others_agree() -> None:
    places = ring(16)
    ties = chain(places, np.random.default_rng(2))
    ties += [Tie(k, (k + 2) % 16, seen_from(places[k], places[(k + 2) % 16]), SURE) for k in range(16)]
    wrong = Tie(2, 10, Pose(1.0, 1.0, 0.0), SURE)
    solved = solve(started(ties), [*ties, wrong], north(places))
    off = [math.hypot(p.x_m - q.x_m, p.y_m - q.y_m) for p, q in zip(solved.poses, places, strict=True)]
    assert max(off) < 0.2


def test_what_the_compass_says_holds_the_headings_but_not_where_it_is_disturbed() -> None:
    places = ring(30)
    ties = chain(places, np.random.default_rng(3))
    told = {k: p.heading_rad for k, p in enumerate(places)}
    told |= {k: told[k] + 0.6 for k in (9, 10, 11)}
    solved = solve(started(ties), ties, Compass(told, math.radians(3.0)))
    off = [
        math.degrees(abs((p.heading_rad - q.heading_rad + 3.0) % 6.2832 - 3.0))
        for p, q in zip(solved.poses, places, strict=True)
    ]
    assert max(off) < 3.0


def test_stations_fall_into_the_parts_that_ties_connect() -> None:
    tie = Pose(0.0, 0.0, 0.0)
    ties = [Tie(1, 4, tie, SURE), Tie(4, 7, tie, SURE), Tie(2, 3, tie, SURE), Tie(3, 99, tie, SURE)]
    assert parts([1, 2, 3, 4, 5, 7], ties) == [[1, 4, 7], [2, 3], [5]]


def test_one_station_alone_is_solved() -> None:
    solved = solve({5: Pose(1.0, 2.0, 3.0)}, [], Compass({5: 3.1}, 0.1))
    assert solved.poses == (Pose(1.0, 2.0, 3.0),)
    assert not solved.covariance.any()


def test_stations_of_one_heading_share_the_error_of_the_compass() -> None:
    """A long straight chain is bent by its ties; a compass as far off at all of them holds it straight."""
    rng = np.random.default_rng(4)
    off = math.radians(3.0)
    places = [Pose(2.0 * k, 0.0, 1.0) for k in range(25)]
    seen = [seen_from(a, b) for a, b in pairwise(places)]
    bends = rng.normal(math.radians(0.5), math.radians(1.0), len(seen))
    loose = np.diag([1.0 / 0.02**2, 1.0 / 0.02**2, 1.0 / math.radians(1.0) ** 2])
    ties = [
        Tie(k, k + 1, Pose(p.x_m, p.y_m, p.heading_rad + b), loose)
        for k, (p, b) in enumerate(zip(seen, bends, strict=True))
    ]
    start = {0: places[0]}
    for tie in ties:
        start[tie.other] = put_at(start[tie.one], tie.pose)
    solved = solve(start, ties, Compass({k: p.heading_rad + off for k, p in enumerate(places)}, math.radians(4.0)))
    turned = [math.degrees(p.heading_rad - 1.0) for p in solved.poses]
    assert abs(start[24].heading_rad - 1.0) > math.radians(8.0)
    assert max(map(abs, turned)) < 2.5
    assert math.hypot(solved.poses[-1].x_m - 48.0, solved.poses[-1].y_m) < 3.0 * math.sqrt(
        float(np.linalg.eigvalsh(solved.of(24)[:2, :2])[-1])
    )
