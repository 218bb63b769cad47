"""The same place, however the map lies, and however fine it is: the same holes, filled the same way."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from fill.closing import close_holes
from fill.prior import prior
from mapping.values import FREE, OCCUPIED, UNKNOWN

State = NDArray[np.uint8]
Layer = NDArray[np.float64]

_HALF_M = (2.4, 1.7)  # of the room, from its middle
_WALL_M = 0.15
_HOLES_M = ((0.5, 1.7, 0.35), (-1.2, -1.7, 0.25), (2.4, 0.3, 0.3))  # x, y and half the length of what is lost
_SIDE_M = 7.2


def room(cell_m: float, turn_rad: float = 0.0, east_m: float = 0.0, mirrored: bool = False) -> State:
    """A room with three holes in its walls, each with the water before it lost, turned, shifted and mirrored."""
    x, y = places(cell_m, turn_rad, east_m, mirrored)
    out = np.maximum(np.abs(x) - _HALF_M[0], np.abs(y) - _HALF_M[1])
    state = np.where(out < 0.0, FREE, UNKNOWN).astype(np.uint8)
    state[(out >= 0.0) & (out <= _WALL_M)] = OCCUPIED
    for hole_x, hole_y, half in _HOLES_M:
        state[np.hypot(x - hole_x, y - hole_y) <= half] = UNKNOWN
    return state


def places(cell_m: float, turn_rad: float, east_m: float, mirrored: bool) -> tuple[Layer, Layer]:
    """Where in the room, x and y in m, each cell lies."""
    rows, cols = (np.indices((round(_SIDE_M / cell_m),) * 2) + 0.5) * cell_m - _SIDE_M / 2.0
    x = (cols - east_m) * math.cos(turn_rad) + rows * math.sin(turn_rad)
    y = rows * math.cos(turn_rad) - (cols - east_m) * math.sin(turn_rad)
    return (-x if mirrored else x), y


def filled(state: State, cell_m: float) -> NDArray[np.bool_]:
    layer = np.zeros(state.shape, bool)
    for each in close_holes(state, 1.6 / cell_m, prior().hole):
        layer[each.cells[:, 0], each.cells[:, 1]] = True
    return layer


def off_wall_cells(layer: NDArray[np.bool_], cell_m: float, *lie: float | bool) -> Layer:
    """How far the filled cells ``(n,)`` are from the true wall, in cells."""
    x, y = places(cell_m, *lie)  # type: ignore[arg-type]
    out = np.maximum(np.abs(x) - _HALF_M[0], np.abs(y) - _HALF_M[1])[layer]
    return np.maximum(np.maximum(-out, out - _WALL_M), 0.0) / cell_m


def closed(layer: NDArray[np.bool_], cell_m: float, *lie: float | bool) -> list[bool]:
    """Whether each hole has a fill over most of its length."""
    x, y = places(cell_m, *lie)  # type: ignore[arg-type]
    return [
        int(np.count_nonzero(layer & (np.hypot(x - hx, y - hy) <= half))) * cell_m >= half for hx, hy, half in _HOLES_M
    ]


@settings(max_examples=12, deadline=None)
@given(turn=st.floats(0.0, math.tau), east=st.floats(-0.4, 0.4), mirrored=st.booleans())
def test_however_the_map_lies_the_same_holes_are_closed_within_a_cell_of_the_wall(
    turn: float, east: float, mirrored: bool
) -> None:
    lie = (turn, east, mirrored)
    layer = filled(room(0.05, *lie), 0.05)
    assert closed(layer, 0.05, *lie) == [True, True, True]
    assert np.all(off_wall_cells(layer, 0.05, *lie) <= 1.5)


@pytest.mark.parametrize("cell_m", [0.03, 0.05, 0.1])
@pytest.mark.parametrize("turn_deg", [0, 23])
def test_fine_or_coarse_the_same_holes_are_closed(cell_m: float, turn_deg: int) -> None:
    lie = (math.radians(turn_deg), 0.0, False)
    layer = filled(room(cell_m, *lie), cell_m)
    assert closed(layer, cell_m, *lie) == [True, True, True]
    assert np.all(off_wall_cells(layer, cell_m, *lie) <= 1.5)
