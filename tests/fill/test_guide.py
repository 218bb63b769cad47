"""Where to station next."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from fill.filler import filled_grid
from fill.guide import guide
from fill.values import Filled, Hole
from mapping.values import FREE, OCCUPIED, UNKNOWN, Grid


def filled_of(state: NDArray[np.uint8], holes: tuple[Hole, ...] = ()) -> Filled:
    return filled_grid(Grid(0.05, 0.0, 0.0, np.zeros(state.shape, np.float32), state), holes, np.zeros((0, 2)))


def room() -> NDArray[np.uint8]:
    state = np.full((80, 120), UNKNOWN, np.uint8)
    state[10:70, 10:110] = OCCUPIED
    state[13:67, 13:107] = FREE
    return state


def test_a_finished_room_asks_for_nothing() -> None:
    assert guide(filled_of(room()), {0: (3.0, 2.0)}) == ()


def test_a_place_is_named_that_sees_the_unseen_edge() -> None:
    state = room()
    state[13:67, 90:110] = UNKNOWN
    goals = guide(filled_of(state), {3: (1.5, 2.0)})
    assert 1 <= len(goals) <= 3
    best = goals[0]
    assert state[int(best.y_m / 0.05), int(best.x_m / 0.05)] == FREE
    assert best.edge_m == pytest.approx(54 * 0.05, abs=0.5)
    assert "m of unseen edge" in best.why
    assert best.why.endswith("m from station 3")
    assert 0.8 <= np.hypot(best.x_m - 1.5, best.y_m - 2.0) <= 3.0


def test_a_doubtful_fill_is_a_reason_and_a_sure_one_is_not() -> None:
    state = room()
    state[10:13, 50:60] = UNKNOWN
    cells = np.argwhere(state[:13, 50:60] == UNKNOWN)[-30:].astype(np.int32) + np.array([0, 50], np.int32)

    def hole(certainty: float) -> Hole:
        each = np.full(len(cells), certainty, np.float32)
        return Hole(0, cells, each, certainty, np.zeros((2, 2)), 0.5, "line", "a test")

    doubtful = guide(filled_of(state, (hole(0.3),)), {0: (5.0, 3.0)})
    assert [goal.doubtful for goal in doubtful] == [1]
    assert "1 doubtful fill" in doubtful[0].why
    assert guide(filled_of(state, (hole(0.9),)), {0: (5.0, 3.0)}) == ()


@pytest.mark.parametrize("shape", [(0, 0), (1, 1), (30, 30)])
def test_without_water_there_is_no_goal(shape: tuple[int, int]) -> None:
    assert guide(filled_of(np.zeros(shape, np.uint8)), {}) == ()


def test_a_station_outside_the_grid_is_no_trouble() -> None:
    state = room()
    state[13:67, 90:110] = UNKNOWN
    assert guide(filled_of(state), {0: (-50.0, -50.0)}) == ()
    assert guide(filled_of(state), {})
