from __future__ import annotations

import math

import numpy as np

from config.schema import Map
from mapping.grid import Cells, cells_of
from mapping.levels import levels_of
from mapping.sight import sight_of
from mapping.values import Pose, Returns, Scan
from tests.mapping.rooms import BIN_M, RECTANGLE, STEP_RAD, TUNNEL, cast


def cells(walls: np.ndarray, x_m: float = 0.0, y_m: float = 0.0) -> Cells:
    """What a scan says that sees walls where they are."""
    bearing = np.arange(200.0) * STEP_RAD
    range_m = np.array([cast(walls, x_m, y_m, float(b))[0] for b in bearing])
    range_m[range_m > 7.0] = np.nan
    scan = Scan(0, 0, 1, 0.0, 1.0, bearing, np.zeros((200, 400), np.uint8), BIN_M, STEP_RAD, "full")
    returns = Returns(range_m, np.where(np.isfinite(range_m), 0.02, np.nan), np.nan_to_num(range_m))
    return cells_of(Pose(x_m, y_m, 0.0), sight_of(scan, returns, Map()).evidence, Map().cell_m)


def test_rings_of_a_well_at_several_depths_are_several_plans() -> None:
    turn = np.arange(60) / 60.0 * 2.0 * math.pi
    well = 2.0 * np.stack([np.sin(turn), np.cos(turn)], axis=1)
    drawn = [cells(well), cells(1.2 * well), cells(well, 0.3), cells(1.2 * well, 0.3), cells(0.8 * well)]
    assert levels_of([1.0, 2.0, 1.2, 2.1, 0.2], drawn, Map()) == [[0, 2], [1, 3], [4]]
    assert levels_of([1.0, 1.4, 1.2, 1.3, 0.8], drawn, Map()) == [[0, 1, 2, 3, 4]]


def test_upright_walls_are_one_plan_at_all_depths() -> None:
    drawn = [cells(RECTANGLE), cells(RECTANGLE, 1.0, 0.5), cells(RECTANGLE, 2.0)]
    assert levels_of([1.0, 2.0, 3.0], drawn, Map()) == [[0, 1, 2]]


def test_a_passage_that_goes_down_is_one_plan() -> None:
    drawn = [cells(TUNNEL, x) for x in (-30.0, -15.0, 0.0, 15.0)]
    assert levels_of([1.0, 2.0, 3.0, 4.0], drawn, Map()) == [[0, 1, 2, 3]]
    assert levels_of([math.nan] * 4, drawn, Map()) == [[0, 1, 2, 3]]
    assert levels_of([], [], Map()) == []
