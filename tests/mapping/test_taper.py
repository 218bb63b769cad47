from __future__ import annotations

import math

import numpy as np
import pytest

from config.schema import Map
from mapping.register import Match
from mapping.sight import Sight, sight_of
from mapping.taper import axis_of, best_scaled, scaled, unscaled
from mapping.values import Pose, Returns, Scan
from mapping.view import View
from tests.mapping.rooms import BIN_M, STEP_RAD, cast


def well(radius_m: float = 2.0) -> np.ndarray:
    """A well about a place that is not the origin."""
    turn = np.arange(60) / 60.0 * math.tau
    return np.array([0.7, -0.3]) + radius_m * np.stack([np.sin(turn), np.cos(turn)], axis=1)


def sight(walls: np.ndarray, x_m: float, y_m: float) -> Sight:
    bearing = np.arange(200.0) * STEP_RAD
    range_m = np.array([cast(walls, x_m, y_m, float(b))[0] for b in bearing])
    scan = Scan(0, 0, 1, 0.0, 1.0, bearing, np.zeros((200, 400), np.uint8), BIN_M, STEP_RAD, "full")
    return sight_of(scan, Returns(range_m, np.full(200, 0.02), range_m), Map())


def match_at(pose: Pose, height: float) -> Match:
    return Match(pose, 0.01 * np.eye(3), 20.0, 5.0, 1.0, 0.0, 0.5, height, 1.5, 0.0, Pose(9.0, 9.0, 0.0), 0.0, False)


def test_the_axis_is_the_middle_of_the_open_water() -> None:
    assert axis_of(sight(well(), 0.0, 0.0).view.field) == pytest.approx([0.7, -0.3], abs=0.06)


def test_a_scaled_scan_lies_on_the_walls_of_the_other_level_at_the_scaled_place() -> None:
    lower = sight(well(2.6), 1.5, 0.4)
    axis, scale = np.array([0.7, -0.3]), 1.3
    at = axis + (np.array([1.5, 0.4]) - axis) / scale
    points = scaled(lower, 1.0 / scale, Map()).view.points.xy_m + at
    assert np.hypot(*(points - axis).T) == pytest.approx(2.0, abs=0.05)
    found = unscaled(match_at(Pose(float(at[0]), float(at[1]), 0.3), 5.0), scale, axis)
    assert (found.pose.x_m, found.pose.y_m, found.pose.heading_rad) == pytest.approx((1.5, 0.4, 0.3))
    assert (found.other.x_m, found.other.y_m) == pytest.approx(axis + scale * (np.array([9.0, 9.0]) - axis))
    assert np.linalg.eigvalsh(found.covariance[:2, :2] - 0.01 * np.eye(2)).min() > 0.0


def test_the_best_scale_is_found_between_those_that_are_tried() -> None:
    lower, reference = sight(well(2.6), 0.7, -0.3), sight(well(), 0.7, -0.3)
    tried: list[float] = []

    def fit(view: View) -> Match:
        radius = float(np.hypot(*view.points.xy_m.T).mean())
        tried.append(radius)
        return match_at(Pose(0.7, -0.3, 0.0), -abs(radius - 2.0))

    matches = best_scaled(lower, reference.view, 1.0, Map(), fit)
    assert len(matches) == len(tried) == 13
    assert max(matches, key=lambda m: m.height).height > -0.05
