from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from config.schema import Map
from mapping import grid as grids
from mapping.beam import PolarEvidence, polar_evidence
from mapping.values import FREE, OCCUPIED, UNKNOWN, Grid, Pose, Returns, Scan
from tests.mapping.rooms import RECTANGLE, STEP_RAD, cast

BEARING = np.arange(200, dtype=np.float64) * STEP_RAD


def evidence_of(walls: np.ndarray, sd_m: float = 0.02, silent: slice = slice(0, 0)) -> PolarEvidence:
    range_m = np.array([cast(walls, 0.0, 0.0, float(b))[0] for b in BEARING])
    free_m = range_m.copy()
    range_m[silent], free_m[silent] = np.nan, 0.0
    scan = Scan(0, 0, 1, 0.0, 0.0, BEARING, np.zeros((200, 1), np.uint8), 0.02, STEP_RAD, "full")
    return polar_evidence(scan, Returns(range_m, np.where(range_m > 0, sd_m, np.nan), free_m), math.radians(3.0), 0.05)


def cells(grid: Grid, state: int) -> np.ndarray:
    row, col = np.nonzero(grid.state == state)
    return np.stack([grid.x0_m + (col + 0.5) * grid.cell_m, grid.y0_m + (row + 0.5) * grid.cell_m], axis=1)


def off_walls(xy: np.ndarray) -> np.ndarray:
    (west, south), (east, north) = RECTANGLE.min(axis=0), RECTANGLE.max(axis=0)
    outside = np.hypot(
        np.maximum(np.maximum(west - xy[:, 0], xy[:, 0] - east), 0.0),
        np.maximum(np.maximum(south - xy[:, 1], xy[:, 1] - north), 0.0),
    )
    inside = np.minimum.reduce([xy[:, 0] - west, east - xy[:, 0], xy[:, 1] - south, north - xy[:, 1]])
    return np.asarray(np.where(inside > 0, inside, outside))


def test_a_room_has_thin_straight_walls_and_open_water() -> None:
    grid = grids.render([(Pose(0.0, 0.0, 0.0), evidence_of(RECTANGLE))], Map())
    walls, water = cells(grid, OCCUPIED), cells(grid, FREE)
    assert off_walls(walls).max() < 0.11
    assert len(walls) * 0.05 < 3.0 * 25.0
    assert len(water) * 0.0025 == pytest.approx(7.0 * 5.5, rel=0.06)
    nothing_behind = (water > RECTANGLE.min(axis=0) - 0.03) & (water < RECTANGLE.max(axis=0) + 0.03)
    assert nothing_behind.all()


def test_row_0_is_the_southmost_and_edges_are_multiples_of_the_cell() -> None:
    grid = grids.render([(Pose(0.013, -0.021, 0.0), evidence_of(RECTANGLE))], Map())
    for edge in (grid.x0_m, grid.y0_m):
        assert edge / grid.cell_m == pytest.approx(round(edge / grid.cell_m), abs=1e-9)
    assert grid.y0_m == pytest.approx(-3.0, abs=0.4)
    assert grid.log_odds.dtype == np.float32
    assert grid.state.dtype == np.uint8


@given(east=st.integers(-60, 60), north=st.integers(-60, 60))
@settings(max_examples=15, deadline=None)
def test_moving_by_whole_cells_moves_the_map(east: int, north: int) -> None:
    evidence = evidence_of(RECTANGLE)
    here = grids.render([(Pose(0.02, 0.01, 0.3), evidence)], Map())
    there = grids.render([(Pose(0.02 + 0.05 * east, 0.01 + 0.05 * north, 0.3), evidence)], Map())
    assert there.x0_m - here.x0_m == pytest.approx(0.05 * east, abs=1e-9)
    assert there.y0_m - here.y0_m == pytest.approx(0.05 * north, abs=1e-9)
    assert np.mean(there.state != here.state) < 0.002


def test_a_quarter_turn_turns_the_map() -> None:
    evidence = evidence_of(RECTANGLE)
    here = grids.render([(Pose(0.0, 0.0, 0.0), evidence)], Map())
    turned = grids.render([(Pose(0.0, 0.0, math.pi / 2.0), evidence)], Map())
    assert turned.state.shape == here.state.shape[::-1]
    assert np.mean(np.rot90(turned.state, -1) != here.state) < 0.02


def test_silent_beams_leave_their_sector_unknown() -> None:
    grid = grids.render([(Pose(0.0, 0.0, 0.0), evidence_of(RECTANGLE, silent=slice(90, 110)))], Map())
    south = cells(grid, UNKNOWN)
    straight_behind = (np.abs(south[:, 0]) < 0.3) & (south[:, 1] > -2.9) & (south[:, 1] < -1.5)
    assert straight_behind.sum() == pytest.approx(0.6 / 0.05 * 1.4 / 0.05, rel=0.15)


def test_a_vague_return_draws_no_wall() -> None:
    assert len(cells(grids.render([(Pose(0, 0, 0), evidence_of(RECTANGLE, sd_m=0.2))], Map()), OCCUPIED)) == 0


def test_evidence_adds_up_and_is_held_within_bounds() -> None:
    evidence = evidence_of(RECTANGLE)
    many = grids.render([(Pose(0.0, 0.0, 0.0), evidence)] * 9, Map())
    assert many.log_odds.max() == pytest.approx(grids.CLAMP_OCCUPIED)
    assert many.log_odds.min() == pytest.approx(grids.CLAMP_FREE)


def test_no_scans_give_no_cells() -> None:
    assert grids.render([], Map()).state.shape == (0, 0)
    assert grids.render([(Pose(0, 0, 0), evidence_of(RECTANGLE, silent=slice(0, 200)))], Map()).state.shape == (0, 0)
