from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from mapping.field import SHORT_SDS, Field, field_of_scan, outline
from mapping.values import Returns
from mapping.view import LEVELS, ROUGH_M, View, points_of, wall_points
from tests.mapping.rooms import RECTANGLE, STEP_RAD, cast

BEARING = np.arange(200.0) * STEP_RAD
TRUE_M = np.array([cast(RECTANGLE, 0.0, 0.0, float(b))[0] for b in BEARING])


def returns_of(range_m: NDArray[np.float64]) -> Returns:
    heard = np.isfinite(range_m)
    return Returns(range_m, np.where(heard, 0.03, np.nan), np.where(heard, range_m, 0.0))


def at(field: Field, x_m: float, y_m: float) -> int:
    return int(field.cells(np.array([x_m]), np.array([y_m]))[0])


def test_water_is_open_up_to_the_walls_and_not_behind_them() -> None:
    field = field_of_scan(BEARING, returns_of(TRUE_M), STEP_RAD, 0.05)
    free = field.free.ravel()
    assert free[at(field, 4.5, 0.0)]
    assert free[at(field, -1.5, -2.5)]
    assert not free[at(field, 5.3, 0.0)]
    assert not free[at(field, 0.0, 2.6)]
    assert field.distance_m.ravel()[at(field, 0.0, 2.5)] <= 0.05


def test_silent_beams_between_two_that_hear_leave_the_water_open() -> None:
    range_m = TRUE_M.copy()
    range_m[10:12] = np.nan
    range_m[40:60] = np.nan
    _, open_m = outline(BEARING, returns_of(range_m), STEP_RAD)
    fine = round(2.0 * math.pi / len(open_m) and len(open_m) * 10.5 / 200)
    assert open_m[fine] == pytest.approx(min(TRUE_M[9], TRUE_M[12]) - SHORT_SDS * 0.03, abs=0.02)
    assert open_m[len(open_m) * 50 // 200] == 0.0


def test_a_ghost_of_one_beam_opens_nothing_behind_its_neighbours() -> None:
    range_m = TRUE_M.copy()
    range_m[100] += 3.0
    _, open_m = outline(BEARING, returns_of(range_m), STEP_RAD)
    assert open_m[len(open_m) // 2] <= max(TRUE_M[99], TRUE_M[101])


def test_a_scan_that_heard_nothing_knows_nothing() -> None:
    field = field_of_scan(BEARING, returns_of(np.full(200, np.nan)), STEP_RAD, 0.05)
    assert not field.free.any()
    assert field.distance_m.min() > 100.0


def test_what_is_no_plain_wall_is_told_apart() -> None:
    range_m = TRUE_M.copy()
    range_m[49:52] = [1.2, 1.15, 1.2]
    returns = returns_of(range_m)
    view = View(points_of(*wall_points(BEARING, returns)), field_of_scan(BEARING, returns, STEP_RAD, 0.05))
    rough = view.codes >= 2 * LEVELS
    assert rough[at(view.field, 1.15, 0.0)]
    assert not rough[at(view.field, 1.15 + 2.0 * ROUGH_M, 0.0)]
    assert not rough[at(view.field, 0.0, 2.5)]
    assert view.codes.max() < 4 * LEVELS
