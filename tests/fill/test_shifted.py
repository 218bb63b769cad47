"""The same place in a map that begins elsewhere: the same holes, filled within one cell of each other."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import ndimage

from fill.closing import close_holes
from fill.prior import prior
from mapping.values import OCCUPIED, UNKNOWN
from tools.bench.holes_maps import read_state

_SIDE = 160
_NEAR = np.ones((3, 3), bool)


def torn(path: Path) -> NDArray[np.uint8]:
    """A piece of a real map with walls, holes torn into these."""
    random = np.random.default_rng(3)
    state = read_state(path)
    low = [(size - min(_SIDE, size)) // 2 for size in state.shape]
    piece = state[low[0] : low[0] + _SIDE, low[1] : low[1] + _SIDE].copy()
    walls = np.argwhere(piece == OCCUPIED)
    rows, cols = np.ogrid[: piece.shape[0], : piece.shape[1]]
    for row, col in walls[random.integers(len(walls), size=8)]:
        piece[(rows - row) ** 2 + (cols - col) ** 2 <= random.uniform(2.0, 6.0) ** 2] = UNKNOWN
    return np.pad(piece, 24, constant_values=UNKNOWN)  # no way is cut off by where the grid ends


def filled(state: NDArray[np.uint8]) -> NDArray[np.bool_]:
    layer = np.zeros(state.shape, bool)
    for each in close_holes(state, 30.0, prior().hole):
        layer[each.cells[:, 0], each.cells[:, 1]] = True
    return layer


@pytest.mark.parametrize("name", ["aces", "fhw", "infinite-corridor"])
def test_where_a_map_begins_changes_no_fill(shared_data: Path, name: str) -> None:
    state = torn(shared_data / "grids" / f"{name}.npz")
    there = filled(state)
    assert there.any()
    for rows, cols in ((1, 0), (2, 3), (7, 5)):
        shifted = filled(np.pad(state, ((rows, 0), (cols, 0)), constant_values=UNKNOWN))[rows:, cols:]
        assert np.all(ndimage.binary_dilation(there, _NEAR)[shifted])
        assert np.all(ndimage.binary_dilation(shifted, _NEAR)[there])
