"""What gets filled, what stays open, and what is never touched."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from numpy.typing import NDArray
from scipy import ndimage

from config.schema import Fill
from fill.filler import Filler
from fill.values import Filled
from mapping.values import FREE, OCCUPIED, UNKNOWN, Grid

State = NDArray[np.uint8]
Fills = Callable[[State], Filled]


def grid_of(state: State) -> Grid:
    log_odds = np.select([state == FREE, state == OCCUPIED], [-2.0, 2.0], 0.0).astype(np.float32)
    return Grid(0.05, -1.0, 2.0, log_odds, state)


@pytest.fixture
def room() -> State:
    """A room of 60 by 90 cells of water, walls three cells thick, rock unseen around it."""
    state = np.full((90, 120), UNKNOWN, np.uint8)
    state[12:78, 12:108] = OCCUPIED
    state[15:75, 15:105] = FREE
    return state


@pytest.fixture
def fill() -> Fills:
    """Fill a layer of states with the default configuration."""
    return lambda state: Filler(Fill()).update(grid_of(state))


def forget(state: State, rows: slice, cols: slice) -> State:
    cut = state.copy()
    cut[rows, cols] = UNKNOWN
    return cut


def leaks(filled: Filled) -> bool:
    """Whether water of the room reaches the grid's edge, also by corners."""
    wall = (filled.grid.state == OCCUPIED) | (filled.hole >= 0)
    parts, _ = ndimage.label(~wall, np.ones((3, 3)))
    return bool(np.isin(parts[filled.grid.state == FREE], parts[0, 0]).any())


def test_a_finished_room_has_no_end_and_no_fill(room: State, fill: Fills) -> None:
    filled = fill(room)
    assert filled.holes == ()
    assert len(filled.open_ends_m) == 0


@pytest.mark.parametrize("length", [4, 8, 14, 22])
def test_a_straight_gap_is_closed_along_the_wall(room: State, fill: Fills, length: int) -> None:
    filled = fill(forget(room, slice(12, 16), slice(50, 50 + length)))
    assert len(filled.holes) == 1
    hole = filled.holes[0]
    assert set(hole.cells[:, 1]) == set(range(50, 50 + length))
    assert hole.cells[:, 0].min() >= 12
    assert hole.cells[:, 0].max() <= 14
    assert hole.gap_m == pytest.approx(length * 0.05, abs=0.11)
    assert not leaks(filled)


def test_a_missing_corner_is_closed_where_the_walls_meet(room: State, fill: Fills) -> None:
    filled = fill(forget(room, slice(10, 24), slice(10, 24)))
    assert [hole.curve for hole in filled.holes] == ["corner"]
    assert filled.hole[13, 13] == 0
    assert not leaks(filled)


def test_a_gap_in_a_round_wall_follows_the_arc(fill: Fills) -> None:
    rows, cols = np.ogrid[:120, :120]
    away = np.hypot(rows - 60, cols - 60)
    state = np.full((120, 120), UNKNOWN, np.uint8)
    state[away < 40] = FREE
    state[np.abs(away - 40.5) <= 1.5] = OCCUPIED
    cut = state.copy()
    cut[(np.hypot(rows - 101, cols - 60) < 9) & (away > 37)] = UNKNOWN
    filled = fill(cut)
    assert not leaks(filled)
    cells = np.concatenate([hole.cells for hole in filled.holes])
    assert np.all(np.abs(np.hypot(cells[:, 0] - 60, cells[:, 1] - 60) - 40.5) <= 3.0)


def test_a_doorway_seen_open_stays_open(room: State, fill: Fills) -> None:
    state = room.copy()
    state[2:15, 50:66] = FREE
    filled = fill(state)
    assert not np.any(filled.hole[2:15, 50:66] >= 0)


def two_chambers() -> State:
    """Two chambers with rock between them, and 20 cells of it never seen."""
    state = np.full((80, 140), UNKNOWN, np.uint8)
    for left in (10, 68):
        state[10:70, left : left + 54] = OCCUPIED
        state[13:67, left + 3 : left + 51] = FREE
    state[30:50, 58:74] = UNKNOWN
    return state


def test_a_way_between_two_chambers_stays_open_though_its_middle_was_not_seen(fill: Fills) -> None:
    state = two_chambers()
    state[27:30, 61:71] = state[50:53, 61:71] = OCCUPIED  # a passage through the rock, whose walls were seen
    filled = fill(state)
    assert not np.any(filled.hole[36:44, 58:74] >= 0)


def test_a_way_between_two_chambers_stays_open_though_nothing_of_it_was_seen(fill: Fills) -> None:
    filled = fill(two_chambers())
    assert not np.any(filled.hole[36:44, 58:74] >= 0)


def test_pillars_get_no_fill(room: State, fill: Fills) -> None:
    state = room.copy()
    rows, cols = np.ogrid[:90, :120]
    for row, col in ((35, 40), (35, 52), (55, 80)):
        away = np.hypot(rows - row, cols - col)
        state[away < 4.5] = OCCUPIED
        state[away < 2.5] = UNKNOWN
    assert fill(state).holes == ()


def test_a_branch_that_stops_short_of_a_wall_is_led_onto_its_side(room: State, fill: Fills) -> None:
    state = room.copy()
    state[15:75, 60:63] = OCCUPIED
    cut = state.copy()
    cut[15:24, 60:63] = UNKNOWN
    filled = fill(cut)
    assert {hole.curve for hole in filled.holes} == {"side"}
    assert np.all(filled.hole[15:24, 61] >= 0)


@pytest.mark.parametrize("turn", range(8))
def test_turned_and_mirrored_the_same_hole_is_closed(room: State, fill: Fills, turn: int) -> None:
    def move(layer: State) -> State:
        return np.ascontiguousarray(np.rot90(layer.T if turn >= 4 else layer, turn % 4))

    def closed(filled: Filled) -> State:
        return np.asarray(filled.hole >= 0, np.uint8)

    cut = forget(room, slice(12, 16), slice(50, 62))
    plain = closed(fill(cut))
    moved = closed(fill(move(cut)))
    near = ndimage.binary_dilation(move(plain), np.ones((3, 3), np.uint8)).astype(np.uint8)
    assert moved.any()
    assert np.all(moved <= near)
    assert abs(int(moved.sum()) - int(plain.sum())) <= 0.25 * int(plain.sum())


def test_the_same_grid_gives_the_same_fills(room: State) -> None:
    cut = forget(forget(room, slice(12, 16), slice(50, 60)), slice(40, 52), slice(10, 20))
    one, two = (Filler(Fill()).update(grid_of(cut)) for _ in range(2))
    assert np.array_equal(one.hole, two.hole)
    assert one.certainty.tobytes() == two.certainty.tobytes()


def test_new_evidence_withdraws_a_fill(room: State) -> None:
    filler = Filler(Fill())
    cut = forget(room, slice(12, 16), slice(50, 62))
    assert filler.update(grid_of(cut)).holes
    cut[8:16, 50:62] = FREE
    assert not filler.update(grid_of(cut)).holes


def test_certainty_never_grows_with_distance_from_the_ends(room: State, fill: Fills) -> None:
    hole = fill(forget(room, slice(12, 16), slice(45, 70))).holes[0]
    ends = (hole.ends_m - (-1.0, 2.0)) / 0.05 - 0.5
    away = np.hypot(*(hole.cells[None, :, ::-1] - ends[:, None]).transpose(2, 0, 1)).min(axis=0)
    order = np.argsort(away)
    assert np.all(np.diff(hole.certainty[order].astype(np.float64)) <= 1e-6)
    assert 0.0 < hole.hole_certainty < 1.0


@pytest.mark.parametrize("shape", [(0, 0), (0, 5), (1, 1), (2, 9)])
@pytest.mark.parametrize("value", [UNKNOWN, FREE, OCCUPIED])
def test_tiny_grids_are_fine(fill: Fills, shape: tuple[int, int], value: int) -> None:
    filled = fill(np.full(shape, value, np.uint8))
    assert filled.holes == ()
    assert filled.hole.shape == shape


@settings(max_examples=20, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(noise=hnp.arrays(np.uint8, (30, 40), elements=st.sampled_from([UNKNOWN, UNKNOWN, FREE, OCCUPIED])))
def test_nothing_measured_is_touched_and_holes_are_whole(fill: Fills, noise: State) -> None:
    state = np.kron(noise, np.ones((2, 2), np.uint8))
    before = state.copy()
    filled = fill(state)
    assert np.array_equal(filled.grid.state, before)
    assert np.all(state[filled.hole >= 0] == UNKNOWN)
    assert np.array_equal(filled.hole >= 0, filled.certainty > 0)
    for hole in filled.holes:
        layer = filled.hole == hole.index
        assert ndimage.label(layer, np.ones((3, 3)))[1] == 1
        assert int(layer.sum()) == len(hole.cells)


def test_walls_that_run_out_of_the_grid_are_filled_like_others(fill: Fills) -> None:
    for seed in range(25):
        random = np.random.default_rng(seed)
        height, width = random.integers(20, 90, 2)
        rough = ndimage.gaussian_filter(random.normal(size=(height, width)), random.uniform(1.0, 5.0))
        state = np.full(rough.shape, FREE, np.uint8)
        state[np.abs(rough - np.median(rough)) < rough.std() * random.uniform(0.1, 0.4)] = OCCUPIED
        unseen = ndimage.gaussian_filter(random.normal(size=rough.shape), 4.0) > random.uniform(0.0, 0.1)
        state[unseen] = UNKNOWN
        filled = fill(state)
        assert not np.any((filled.hole >= 0) & (state != UNKNOWN))
