"""Odometry between scans: summed by the compass, trusted as far as it is told, asked where walls let a scan slide."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from drivers.readings import Odometry
from mapping.led import LED_SD_M, WAY_SD_M, along, led, walked
from mapping.odometry import REST_SD_M, UNSEEN_M_S, Odometer
from mapping.prior import Cloud, Hint, Prior
from mapping.register import Match
from mapping.values import Displacement, Pose
from mapping.verdict import SEEN, judge
from tests.mapping.rooms import TUNNEL
from tests.mapping.test_echoes import scan_of

S = 1_000_000_000


def moved(at_s: float, dx_m: float, dy_m: float, *, in_vehicle: bool = True, dt_s: float = 1.0) -> Odometry:
    return Odometry(int(at_s * S), dt_s, dx_m, dy_m, 0.01, in_vehicle, "log")


def test_ways_in_the_vehicle_s_axes_turn_with_its_heading() -> None:
    odometer = Odometer()
    for second in range(1, 11):
        # Ahead by 0.2 m a second: north for five seconds, then east.
        odometer.add(moved(second, 0.0, 0.2), 0.0 if second <= 5 else math.pi / 2)
    told = odometer.between(0, 10 * S)
    assert told is not None
    assert (told.dx_m, told.dy_m) == pytest.approx((1.0, 1.0))
    assert told.sd_m == pytest.approx(10 * 0.01 + REST_SD_M)
    half = odometer.between(2 * S, int(6.5 * S))
    assert half is not None
    assert (half.dx_m, half.dy_m) == pytest.approx((0.3, 0.6))


def test_ways_by_the_north_stay_as_they_are() -> None:
    odometer = Odometer()
    for second in range(1, 4):
        odometer.add(moved(second, 0.3, -0.1, in_vehicle=False), 2.0)
    told = odometer.between(0, 3 * S)
    assert told is not None
    assert (told.dx_m, told.dy_m) == pytest.approx((0.9, -0.3))


def test_what_is_not_told_of_makes_the_way_less_sure_or_unknown() -> None:
    odometer = Odometer()
    for second in (1, 2, 3, 4, 6, 7, 8, 9, 10):
        odometer.add(moved(second, 0.1, 0.0), 0.0)
    told = odometer.between(0, 10 * S)
    assert told is not None
    assert told.sd_m == pytest.approx(9 * 0.01 + REST_SD_M + UNSEEN_M_S * 1.0)
    assert odometer.between(0, 13 * S) is None
    assert Odometer().between(0, S) is None


def test_each_scan_gets_the_way_from_the_one_before() -> None:
    odometer = Odometer()
    assert odometer.since_last(0) is None
    assert odometer.since_last(S) is None, "nothing was told"
    for second in range(2, 8):
        odometer.add(moved(second, 1.0, 0.0), 0.0)
        odometer.add(moved(second, 1.0, 0.0), 0.0)  # told twice, counted once
    told = odometer.since_last(7 * S)
    assert told is not None
    assert told.dx_m == pytest.approx(6.0)


def test_ways_are_joined_and_turned_into_the_map() -> None:
    ways = [Displacement(1.0, 0.0, 0.1), Displacement(0.0, 2.0, 0.2)]
    hint = led(ways, math.pi / 2, back=False, reach_m=3.0)
    assert hint is not None
    # A map that is turned clockwise by a quarter: east becomes south, north becomes east.
    assert (hint.dx_m, hint.dy_m, hint.sd_m) == pytest.approx((2.0, -1.0, 0.3))
    back = led(ways, 0.0, back=True, reach_m=3.0)
    assert back is not None
    assert (back.dx_m, back.dy_m) == pytest.approx((-1.0, -2.0))
    assert led([*ways, None], 0.0, back=False, reach_m=3.0) is None
    assert led([], 0.0, back=False, reach_m=3.0) is None
    assert led([Displacement(9.0, 0.0, 2.0)], 0.0, back=False, reach_m=3.0) is None


MATCH = Match(
    pose=Pose(1.8, 0.3, 1.0), covariance=np.diag([0.04, 0.0004, 0.001]), margin=9.0, odds=1.1, overlap=0.6,
    weak_rad=math.pi / 2, hold=0.02, height=1.0, fit=0.7, behind=0.0, other=Pose(0, 0, 0), astray=1.0, ridge=False,
)  # fmt: skip
PRIOR = Prior(2.4, 0.0, 0.12, 1.0, 0.07, gaussian=True)


def test_a_scan_that_can_slide_is_put_where_odometry_led_along_its_way_only() -> None:
    put = along(MATCH, PRIOR)
    assert (put.pose.x_m, put.pose.y_m) == pytest.approx((2.4, 0.3))
    assert put.covariance == pytest.approx(np.diag([0.12**2, 0.0004, 0.001]), abs=1e-9)
    held = replace(MATCH, hold=0.3)
    assert along(held, PRIOR) is held
    pilot = replace(PRIOR, reach_m=0.5)
    assert along(MATCH, pilot) is MATCH, "a pilot's word is not so sure"


def test_the_least_uncertainty_of_odometry_is_below_a_pilot_s() -> None:
    hint = led([Displacement(1.0, 0.0, 0.02)], 0.0, back=False, reach_m=3.0)
    assert hint is not None
    prior = hint.prior(5.0, 5.0, 0.0, 0.1)
    assert (prior.reach_m, prior.is_led) == (LED_SD_M, True)
    assert prior.astray(np.array([6.0, 5.3, 0.0])) == pytest.approx(3.0)


def test_a_hint_turned_and_back_is_the_hint() -> None:
    hint = Hint(1.0, 2.0, 0.3)
    east = hint.turned(math.pi / 2)
    assert (east.dx_m, east.dy_m, east.sd_m) == pytest.approx((2.0, -1.0, 0.3))
    back = east.turned(-math.pi / 2)
    assert (back.dx_m, back.dy_m) == pytest.approx((1.0, 2.0))


def cloud_of(sd_m: float) -> Cloud:
    return Cloud(2.4, 0.2, np.diag([sd_m**2, 0.05**2]))


def test_a_scan_is_put_between_its_walls_and_its_way_along_the_way_only() -> None:
    put = walked(MATCH, cloud_of(0.5), 0.75)
    assert (put.pose.x_m, put.pose.y_m) == pytest.approx((1.95, 0.3))
    assert put.covariance[0, 0] == pytest.approx(0.75 * 0.04 + 0.25 * 0.25 + 0.1875 * 0.36)
    assert (put.covariance[1, 1], put.covariance[2, 2]) == pytest.approx((0.0004, 0.001))
    assert np.all(put.covariance - np.diag(np.diag(put.covariance)) == 0.0)
    assert walked(MATCH, cloud_of(0.5), 1.0).pose.x_m == pytest.approx(1.8)
    assert walked(MATCH, cloud_of(0.5), 0.0).pose.x_m == pytest.approx(2.4)


def test_where_walls_do_not_tell_a_scan_is_placed_as_surely_as_its_way_was_seen() -> None:
    scan, here = scan_of(TUNNEL), Prior(0.0, 0.0, 3.0, 1.0, 0.07)
    assert MATCH.odds < SEEN
    assert judge(scan, MATCH, 0, here, chained=True).status != "placed"
    seen = judge(scan, MATCH, 0, replace(here, cloud=cloud_of(0.5)), chained=True)
    assert (seen.status, seen.piece) == ("placed", 0)
    assert seen.covariance[0, 0] > MATCH.covariance[0, 0]
    assert "90 degrees" in seen.why


@pytest.mark.parametrize(
    ("match", "sd_m"),
    [(MATCH, 1.1 * WAY_SD_M), (replace(MATCH, astray=3.5), 0.5), (replace(MATCH, overlap=0.1), 0.5)],
)
def test_no_scan_is_placed_by_a_way_that_was_not_seen_or_led_elsewhere(match: Match, sd_m: float) -> None:
    station = judge(scan_of(TUNNEL), match, 0, Prior(0.0, 0.0, 3.0, 1.0, 0.07, cloud=cloud_of(sd_m)), chained=True)
    assert station.status != "placed"
    assert station.piece == 1
