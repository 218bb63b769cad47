from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from config.schema import Map
from mapping import grid as grids
from mapping.beam import HINT_LOG_ODDS, PolarEvidence, of_face, polar_evidence, spread
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


def test_a_canvas_draws_to_the_byte_what_a_full_drawing_does() -> None:
    rng = np.random.default_rng(4)
    evidence = [evidence_of(RECTANGLE, sd_m=0.01 * (k + 1)) for k in range(6)]
    placed = [(Pose(*rng.normal(0.0, 1.0, 3)), each) for each in evidence]
    canvas = grids.Canvas(Map())
    drawn(canvas, placed)
    moved = [*placed[:2], (Pose(0.5, -0.2, 0.1), evidence[2]), *placed[3:5], (Pose(0.1, 0.1, 0.0), evidence[0])]
    whole, again = grids.render(moved, Map()), drawn(canvas, moved)
    assert (again.x0_m, again.y0_m) == (whole.x0_m, whole.y0_m)
    assert again.log_odds.tobytes() == whole.log_odds.tobytes()
    assert again.state.tobytes() == whole.state.tobytes()
    assert drawn(canvas, []).state.shape == (0, 0)


def drawn(canvas: grids.Canvas, placed: list[tuple[Pose, PolarEvidence]]) -> Grid:
    return grids.gather([canvas.cells(pose, evidence) for pose, evidence in placed], Map())


def test_only_scans_that_moved_are_worked_out_anew(monkeypatch: pytest.MonkeyPatch) -> None:
    worked_out: list[Pose] = []
    honest = grids.cells_of

    def counted(pose: Pose, evidence: PolarEvidence, cell_m: float, reaches_m: np.ndarray) -> grids.Cells:
        worked_out.append(pose)
        return honest(pose, evidence, cell_m, reaches_m)

    monkeypatch.setattr(grids, "cells_of", counted)
    placed = [(Pose(0.1 * k, 0.0, 0.0), evidence_of(RECTANGLE)) for k in range(4)]
    canvas = grids.Canvas(Map())
    drawn(canvas, placed)
    drawn(canvas, [*placed[:3], (Pose(2.0, 0.0, 0.0), placed[3][1])])
    assert worked_out == [pose for pose, _ in placed] + [Pose(2.0, 0.0, 0.0)]


def test_a_face_is_free_before_it_occupied_in_it_and_hardly_told_behind_it() -> None:
    behind_m = np.array([-0.2, -0.06, 0.0, 0.01, 0.09, 0.3])
    far_before, before, at, just_behind, behind, far_behind = of_face(behind_m, np.full(6, 0.015), 0.05)
    assert far_before == pytest.approx(-0.9, abs=0.01)
    assert before < 0.0
    assert min(at, just_behind) > 1.1
    assert 0.0 < behind <= HINT_LOG_ODDS
    assert abs(far_behind) < 1e-6
    assert of_face(np.zeros(1), np.full(1, 0.1), 0.05)[0] < at


def test_a_wall_that_is_sure_within_a_cell_is_drawn_and_one_that_may_be_anywhere_is_not() -> None:
    told = of_face(np.array([-0.06, 0.0, 0.06]), np.full(3, 0.04), 0.05)
    wall = math.log(Map().occupied_threshold / (1.0 - Map().occupied_threshold))
    assert told[1] > wall
    assert max(told[0], told[2]) < 0.6 * wall  # a thin line
    assert of_face(np.zeros(1), np.full(1, 0.09), 0.05)[0] < wall


@given(scans=st.integers(1, 8), sd_m=st.floats(0.005, 0.03))
@settings(max_examples=10, deadline=None)
def test_walls_do_not_thicken_with_the_number_of_scans(scans: int, sd_m: float) -> None:
    evidence = evidence_of(RECTANGLE, sd_m=sd_m)
    grid = grids.render([(Pose(0.0, 0.0, 0.0), evidence)] * scans, Map())
    walls = cells(grid, OCCUPIED)
    assert off_walls(walls).max() < 0.08
    assert len(walls) * 0.05 < 2.2 * 25.0


def test_what_one_scan_measured_too_far_is_no_wall_behind_what_many_saw() -> None:
    true, far = evidence_of(RECTANGLE), evidence_of(RECTANGLE * 1.02)
    one, four = (
        cells(grids.render([(Pose(0.0, 0.0, 0.0), e) for e in [true] * sure + [far]], Map()), OCCUPIED)
        for sure in (1, 4)
    )
    assert (off_walls(one) > 0.06).mean() > 0.1
    assert (off_walls(four) > 0.06).mean() < 0.2 * (off_walls(one) > 0.06).mean()
    assert len(four) * 0.05 > 0.95 * 25.0


def test_hints_do_not_add_up_to_a_wall() -> None:
    vague = evidence_of(RECTANGLE, sd_m=0.2)
    grid = grids.render([(Pose(0.0, 0.0, 0.0), vague)] * 20, Map())
    assert len(cells(grid, OCCUPIED)) == 0
    assert 0.4 < grid.log_odds.max() <= HINT_LOG_ODDS


def test_water_between_vague_beams_is_open_no_further_than_they_say() -> None:
    range_m = np.full(200, 3.0)
    returns = Returns(range_m, np.where(np.arange(200) < 100, 0.02, 0.2), np.where(np.arange(200) < 100, 3.0, 1.0))
    fan = spread(BEARING, returns, STEP_RAD, math.radians(3.0))
    half = len(fan.free_m) // 2
    assert fan.free_m[10 : half - 10].min() > 2.99
    assert fan.free_m[half + 10 : -10].max() <= 1.0


def test_a_wall_met_at_a_slant_is_drawn_as_thick_as_one_met_squarely() -> None:
    corridor = np.array([[-9.0, -0.7], [-9.0, 0.7], [9.0, 0.7], [9.0, -0.7]])
    evidence = evidence_of(corridor, sd_m=0.06)  # along a range that the slant stretches, little across the wall
    walls = cells(grids.render([(Pose(0.0, 0.0, 0.0), evidence)], Map()), OCCUPIED)
    aslant = walls[(np.abs(walls[:, 0]) > 1.6) & (np.abs(walls[:, 0]) < 3.0)]
    assert len(np.unique(np.round(aslant[:, 0], 2))) > 0.9 * 2.8 / 0.05
    assert np.abs(np.abs(aslant[:, 1]) - 0.7).max() < 0.08
