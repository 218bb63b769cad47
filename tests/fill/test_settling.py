"""Fills that follow the water's edge where it was seen, and none that follow the edge of what was lost."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import ndimage

from config.schema import Fill
from fill.filler import Filler
from mapping.values import FREE, OCCUPIED, UNKNOWN, Grid

State = NDArray[np.uint8]


def _drawn(water: NDArray[np.bool_]) -> State:
    """Draw a plan of water in rock: its walls two cells thick."""
    behind = ndimage.distance_transform_edt(~water)
    state = np.full(water.shape, UNKNOWN, np.uint8)
    state[(behind > 0) & (behind <= 2.5)] = OCCUPIED
    state[water] = FREE
    return state


def _cave() -> State:
    """Draw a chamber without a straight wall."""
    rows, cols = np.mgrid[:90, :90] - 45.0
    aim = np.arctan2(rows, cols)
    return _drawn(np.hypot(rows, cols) < 32.0 + 2.0 * np.cos(4.0 * aim))


def _filled(state: State) -> NDArray[np.bool_]:
    grid = Grid(0.05, 0.0, 0.0, np.zeros(state.shape, np.float32), state)
    return Filler(Fill(max_gap_m=2.0)).update(grid).hole >= 0


def test_fills_follow_the_edge_of_water_that_was_seen() -> None:
    truth = _cave()
    rows, cols = np.mgrid[:90, :90] - 45.0
    right = []
    for aim in np.linspace(0.2, 6.2, 12):
        gone = (np.abs(np.angle(np.exp(1j * (np.arctan2(rows, cols) - aim)))) < 0.18) & (truth == OCCUPIED)
        filled = _filled(np.where(gone, UNKNOWN, truth).astype(np.uint8))
        right += (truth[filled] == OCCUPIED).tolist()
    assert len(right) > 60
    assert np.mean(right) > 0.93


@pytest.mark.parametrize("halo", [2.5, 3.5, 4.5])
def test_a_fill_does_not_follow_the_edge_of_water_that_was_lost_with_the_wall(halo: float) -> None:
    water = np.zeros((70, 90), bool)
    water[10:50, 10:80] = True
    truth = _drawn(water)
    line = np.ones(truth.shape, bool)
    line[8, 40:48] = False
    lost = (ndimage.distance_transform_edt(line) <= halo) & (truth != UNKNOWN)
    filled = _filled(np.where(lost, UNKNOWN, truth).astype(np.uint8))
    near = ndimage.binary_dilation(truth == OCCUPIED, np.ones((3, 3), np.int8))
    assert filled.any()
    assert near[filled].all()
