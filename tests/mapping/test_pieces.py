from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from config.schema import Map
from mapping.echoes import pick
from mapping.graph import seen_from
from mapping.hypotheses import Fit
from mapping.pieces import Pieces, limited
from mapping.refine import bond, wall_of
from mapping.sight import Sight, sight_of
from mapping.stations import Stations
from mapping.values import Pose, Scan
from mapping.view import points_of
from tests.mapping.rooms import KEYHOLE, RECTANGLE, Stay, pings
from tests.mapping.test_scan_builder import build

STAYS = [Stay(0.3, -0.5, 0.4, 330), Stay(0.1, 0.9, 1.2, 330), Stay(0.2, 2.6, 2.0, 330), Stay(0.6, 4.7, 5.9, 330)]
BEAM = math.radians(3.0)
DOUBT = np.diag([0.05**2, 0.05**2, math.radians(1.0) ** 2])


def sights_of(walls: np.ndarray, stays: list[Stay]) -> list[Sight]:
    """What each stay sees, each taken by itself."""
    scans: list[Scan] = []
    for k, stay in enumerate(stays):
        (scan,) = build(list(pings(walls, [stay], np.random.default_rng(k))))
        scans.append(replace(scan, index=k))
    return [sight_of(scan, pick(scan, Map()), Map()) for scan in scans]


def true(stay: Stay) -> Pose:
    return Pose(stay.x_m, stay.y_m, stay.heading_rad)


@pytest.fixture(scope="module")
def keyhole() -> list[Sight]:
    return sights_of(KEYHOLE, STAYS)


def grown(sights: list[Sight], off_m: float = 0.06) -> Pieces:
    """A piece of the keyhole, each station found a little off."""
    pieces = Pieces(math.radians(4.0), BEAM)
    pieces.begin(0, sights[0], true(STAYS[0]))
    for k in (1, 2, 3):
        seen = seen_from(true(STAYS[k - 1]), true(STAYS[k]))
        base = pieces.pose(k - 1)
        x, y = np.array([base.x_m, base.y_m]) + turned(base.heading_rad, seen) + off_m * np.array([0.6, -0.8])
        heading = base.heading_rad + seen.heading_rad + 0.02
        pieces.grow(k, sights[k], k - 1, Pose(float(x), float(y), heading), DOUBT)
    return pieces


def turned(heading_rad: float, seen: Pose) -> np.ndarray:
    c, s = math.cos(heading_rad), math.sin(heading_rad)
    return np.array([c * seen.x_m + s * seen.y_m, c * seen.y_m - s * seen.x_m])


def test_common_walls_tell_how_two_stations_lie(keyhole: list[Sight]) -> None:
    walls = [wall_of(sight.view.points, BEAM) for sight in keyhole]
    seen = seen_from(true(STAYS[0]), true(STAYS[1]))
    tie = bond((0, walls[0]), (1, walls[1]), replace(seen, x_m=seen.x_m + 0.12, heading_rad=seen.heading_rad + 0.03))
    assert tie is not None
    assert math.hypot(tie.pose.x_m - seen.x_m, tie.pose.y_m - seen.y_m) < 0.03
    assert tie.pose.heading_rad == pytest.approx(seen.heading_rad, abs=math.radians(0.7))
    assert np.linalg.eigvalsh(tie.information)[0] > 1.0


def test_the_two_faces_of_a_thin_wall_are_not_one() -> None:
    x = np.arange(-3.0, 3.0, 0.04)
    here = points_of(np.stack([x, np.full_like(x, 1.0)], axis=1), np.ones_like(x))
    there = points_of(np.stack([x, np.full_like(x, -1.0)], axis=1), np.ones_like(x))
    start = Pose(0.0, 2.1, 0.0)  # it stands behind the wall, whose other face it sees
    assert bond((0, wall_of(here, BEAM)), (1, wall_of(there, BEAM)), start) is None
    facing = bond((0, wall_of(here, BEAM)), (1, wall_of(here, BEAM)), Pose(0.0, 0.1, 0.0))
    assert facing is not None
    assert facing.pose.y_m == pytest.approx(0.0, abs=0.01)


def test_a_straight_wall_tells_nothing_along_it() -> None:
    x, rng = np.arange(-4.0, 4.0, 0.04), np.random.default_rng(1)
    sides = np.concatenate([np.stack([x, np.full_like(x, y)], axis=1) for y in (-0.8, 0.8)])
    one, other = (
        wall_of(points_of(sides + rng.normal(0.0, 0.03, sides.shape), np.ones(len(sides))), BEAM) for _ in "ab"
    )
    tie = bond((0, one), (1, other), Pose(0.2, 0.05, 0.0))
    assert tie is not None
    assert tie.information[1, 1] > 1000.0
    assert tie.information[0, 0] < 0.05 * tie.information[1, 1]


def test_a_bond_is_no_surer_than_its_station() -> None:
    wide = np.diag([1.0, 0.05**2, 0.02**2])
    information = limited(np.diag([500.0, 500.0, 500.0]), wide)
    assert information[0, 0] == pytest.approx(1.0)
    assert information[1, 1] == pytest.approx(500.0)


def test_a_piece_settles_where_its_walls_agree(keyhole: list[Sight]) -> None:
    pieces = grown(keyhole)
    solution = pieces.solution(0)
    for k in (1, 2, 3):
        pose = pieces.pose(k)
        off = np.array([pose.x_m - STAYS[k].x_m, pose.y_m - STAYS[k].y_m])
        assert np.hypot(*off) < 0.08  # 0.18 without the walls
        assert off @ np.linalg.solve(solution.of(k)[:2, :2], off) < 12.0


def test_pieces_that_are_tied_become_one_and_keep_how_they_lie(keyhole: list[Sight]) -> None:
    pieces = Pieces(math.radians(4.0), BEAM)
    pieces.begin(0, keyhole[0], true(STAYS[0]))
    pieces.begin(2, keyhole[2], Pose(50.0, 50.0, 1.0))
    at = Pose(50.0, 50.0, 1.0)
    seen = seen_from(true(STAYS[2]), true(STAYS[3]))
    x, y = turned(at.heading_rad, seen)
    pieces.grow(3, keyhole[3], 2, Pose(50.0 + float(x), 50.0 + float(y), 1.0 + seen.heading_rad), DOUBT)
    assert pieces.all == [(0,), (2, 3)]
    pieces.close(0, 2, true(STAYS[2]), DOUBT)
    assert pieces.all == [(0, 2, 3)]
    for k in (2, 3):
        assert math.hypot(pieces.pose(k).x_m - STAYS[k].x_m, pieces.pose(k).y_m - STAYS[k].y_m) < 0.1
    assert pieces.of(1) == ()


def test_what_only_a_dropped_station_held_falls_apart(keyhole: list[Sight]) -> None:
    pieces = Pieces(math.radians(4.0), BEAM)
    pieces.begin(0, keyhole[0], true(STAYS[0]))
    foreign = sights_of(RECTANGLE, [Stay(3.0, 0.0, 1.0, 330)])[0]
    pieces.grow(1, foreign, 0, Pose(20.0, 0.0, 1.0), DOUBT)
    pieces.grow(2, keyhole[2], 1, Pose(40.0, 0.0, 2.0), DOUBT)
    pieces.drop(1)
    assert pieces.all == [(0,), (2,)]


def test_pieces_are_joined_by_two_witnesses_or_by_one_that_is_very_sure() -> None:
    fit = Fit(Pose(1.0, 2.0, 0.0), DOUBT, height=60.0, margin=13.0, witnesses=2)
    assert fit.is_sure
    assert not replace(fit, witnesses=1).is_sure
    assert replace(fit, witnesses=1, margin=19.0).is_sure
    assert not replace(fit, witnesses=0, margin=40.0).is_sure, "none of its scans lies on known walls"
    assert not replace(fit, margin=40.0, behind=0.2).is_sure, "it would have seen walls from behind"
    assert not replace(fit, margin=11.0).is_sure
    assert not replace(fit, covariance=100.0 * DOUBT).is_sure


def test_the_largest_piece_is_the_map_and_begins_at_its_first_station(keyhole: list[Sight]) -> None:
    foreign = sights_of(RECTANGLE, [Stay(3.0, 0.0, 1.0, 330)])[0]
    stations = Stations(Map())
    stations.add(foreign, None)
    assert [s.piece for s in stations.all] == [0]
    for k, sight in enumerate(keyhole[:3], 1):
        stations.add(replace(sight, scan=replace(sight.scan, index=k)), None)
    assert [s.piece for s in stations.all] == [1, 0, 0, 0]
    assert [s.status for s in stations.all] == ["doubtful", "placed", "placed", "placed"]
    first = stations.all[1].pose
    assert (first.x_m, first.y_m) == (0.0, 0.0)
    assert stations.grid().state.any()


def test_a_piece_that_floats_is_told_as_such_and_lies_where_its_first_scan_may_be(keyhole: list[Sight]) -> None:
    foreign = sights_of(RECTANGLE, [Stay(3.0, 0.0, 1.0, 330), Stay(2.0, 0.6, 1.5, 330)])
    stations = Stations(Map())
    for k, sight in enumerate([*keyhole[:3], *foreign]):
        stations.add(replace(sight, scan=replace(sight.scan, index=k)), None)
    told = stations.all
    assert [s.piece for s in told] == [0, 0, 0, 4, 4]
    assert [s.status for s in told[3:]] == ["unplaced", "unplaced"]
    assert "piece of 2" in told[4].why
    apart = math.hypot(told[4].pose.x_m - told[3].pose.x_m, told[4].pose.y_m - told[3].pose.y_m)
    assert apart == pytest.approx(math.hypot(1.0, 0.6), abs=0.1)
    assert math.hypot(told[3].pose.x_m - told[2].pose.x_m, told[3].pose.y_m - told[2].pose.y_m) < 4.0
    without = stations.grid().log_odds.tobytes()
    assert stations.drop(4)
    assert stations.grid().log_odds.tobytes() == without
