"""Grids that no site gives: nothing, nothing but wall, one wall alone, noise, and all of these large."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from config.schema import Fill
from fill.closing import left_open, open_walls
from fill.filler import Filler
from fill.memory import Memory
from fill.segments import find_walls
from fill.values import Filled
from mapping.values import FREE, OCCUPIED, UNKNOWN, Grid

_LARGE = (2000, 2000)


def fill(state: NDArray[np.uint8]) -> Filled:
    return Filler(Fill()).update(Grid(0.05, 0.0, 0.0, np.zeros(state.shape, np.float32), state))


def noise(side: int) -> NDArray[np.uint8]:
    values = np.repeat(np.array([UNKNOWN, FREE, OCCUPIED], np.uint8), (6, 3, 1))
    return np.random.default_rng(0).choice(values, (side, side))


@pytest.mark.parametrize("value", [UNKNOWN, FREE, OCCUPIED])
def test_a_large_grid_of_one_kind_has_no_hole(value: int) -> None:
    filled = fill(np.full(_LARGE, value, np.uint8))
    assert filled.holes == ()
    assert len(filled.open_ends_m) == 0


def test_one_wall_in_a_large_grid_is_filled_where_it_is_broken() -> None:
    state = np.full(_LARGE, UNKNOWN, np.uint8)
    state[1000:1003, 100:1900] = OCCUPIED
    state[1003:1400, 100:1900] = FREE
    state[1000:1003, 900:910] = UNKNOWN
    (hole,) = fill(state).holes
    assert set(hole.cells[:, 1].tolist()) == set(range(900, 910))


def test_of_noise_only_the_longest_walls_keep_their_ends() -> None:
    state = noise(400)
    ends = open_walls(state == OCCUPIED, state).ends
    assert len(ends) == 1500
    assert 0 < len(open_walls(state[:200, :200] == OCCUPIED, state[:200, :200]).ends) < 1500


def tangle(side: int) -> NDArray[np.uint8]:
    """Combs side by side, all joined: many tips, and no end of a wall."""
    state = np.full((side, side), UNKNOWN, np.uint8)
    state[4:-4, 4] = OCCUPIED
    for spine in range(8, side - 8, 12):
        state[spine, 4:-4] = OCCUPIED
        state[spine - 4 : spine + 5, 7:-4:3] = OCCUPIED
    return state


def test_tips_of_a_tangle_are_noise_and_keep_to_their_walls() -> None:
    state = tangle(160)
    memory = Memory()
    left = []
    for rows, value in ((slice(158, 160), OCCUPIED), (slice(62, 76), FREE), (slice(0, 150), UNKNOWN)):
        state[rows, 5:] = value
        memory.begin()
        walls = memory.walls(state == OCCUPIED, state)
        anew = find_walls(state == OCCUPIED)
        assert sorted(walls.tips[walls.noise].tolist()) == sorted(anew.tips[anew.noise].tolist())
        left.append(int(walls.noise.sum()))
    assert left[0] > left[1] > 1000
    assert left[2] == 0


def test_where_there_are_more_tips_than_any_site_has_memory_tells_the_same_as_scratch() -> None:
    state = noise(400)
    memory = Memory()
    for _ in range(2):
        memory.begin()
        walls, anew = memory.walls(state == OCCUPIED, state), find_walls(state == OCCUPIED)
        assert walls.noise.sum() == anew.noise.sum()
        assert [(end.x, end.y) for end in walls.ends] == [(end.x, end.y) for end in anew.ends]
        state[:, :60] = UNKNOWN
    assert len(left_open(state, [])[0]) == 1500
    assert left_open(state, [])[1] > 0
    assert left_open(state[:200, :200], [])[1] == 0


@pytest.mark.slow
@pytest.mark.parametrize("share", [0.05, 0.5])
def test_large_noise_is_filled_hardly_at_all(share: float) -> None:
    random = np.random.default_rng(0)
    state = np.where(random.random(_LARGE) < 0.3, FREE, UNKNOWN).astype(np.uint8)
    state[random.random(_LARGE) < share] = OCCUPIED
    filled = fill(state)
    assert np.all(state[filled.hole >= 0] == UNKNOWN)
    assert np.count_nonzero(filled.hole >= 0) < 1e-4 * state.size
    assert np.all(np.isfinite(filled.certainty))


@pytest.mark.slow
def test_noise_is_never_filled_over_what_was_seen() -> None:
    state = noise(120)
    filled = fill(state)
    assert np.all(state[filled.hole >= 0] == UNKNOWN)
