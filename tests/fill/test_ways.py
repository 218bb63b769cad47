"""Ways across holes, what is told about them, and which are taken."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from fill.candidates import FEATURES, Candidate
from fill.closing import close_holes, open_walls
from fill.matching import asked, assign, candidates
from fill.prior import prior
from mapping.values import FREE, OCCUPIED, UNKNOWN

State = NDArray[np.uint8]


def slab(gap: slice, halo: int = 0) -> State:
    """A wall three cells thick between two waters, with a gap in it and some of the water beside it lost."""
    state = np.full((60, 100), FREE, np.uint8)
    state[28:31] = OCCUPIED
    state[28 - halo : 31 + halo, gap] = UNKNOWN
    return state


def found(state: State) -> list[Candidate]:
    return candidates(open_walls(state == OCCUPIED, state), state, 40.0)


def told(candidate: Candidate, name: str) -> float:
    return float(candidate.features[FEATURES.index(name)])


def chance(candidate: Candidate) -> float:
    return float(prior().hole.chance(candidate.features[None])[0])


def test_a_strip_between_two_waters_is_snug_and_surely_a_hole() -> None:
    best = max(found(slab(slice(40, 52))), key=chance)
    assert told(best, "snug both") == pytest.approx(1.0)
    assert told(best, "water both") == pytest.approx(1.0)
    assert chance(best) > 0.8


def test_a_crooked_strip_one_cell_wide_is_followed() -> None:
    state = np.full((40, 60), FREE, np.uint8)
    line = [(20, col) for col in range(5, 25)] + [(21, 24), (21, 25), (22, 25), (22, 26), (22, 27), (23, 27), (23, 28)]
    line += [(24, 28), (24, 29), (25, 29), (25, 30)] + [(25, col) for col in range(31, 55)]
    rows, cols = np.array(line).T
    state[rows, cols] = OCCUPIED
    lost = (cols > 22) & (cols < 33)
    state[rows[lost], cols[lost]] = UNKNOWN
    drawn = {tuple(cell) for each in found(state) for cell in each.path.tolist()}
    assert {cell for cell, gone in zip(line, lost.tolist(), strict=True) if gone} <= drawn


def test_no_way_crosses_free_water() -> None:
    random = np.random.default_rng(3)
    state = slab(slice(40, 60), halo=6)
    state[random.random(state.shape) < 0.03] = FREE
    for each in found(state):
        rows, cols = each.path.T
        assert not np.any(state[rows, cols] == FREE)
        assert np.all(np.abs(np.diff(each.path, axis=0)).sum(axis=1) == 1)


def test_specks_inside_a_hole_are_stepping_stones() -> None:
    state = slab(slice(35, 65))
    state[29, 44:46] = state[29, 54] = OCCUPIED
    closed = close_holes(state, 40.0, prior().hole)
    filled = np.zeros(state.shape, bool)
    for each in closed:
        filled[each.cells[:, 0], each.cells[:, 1]] = True
    assert np.all((filled | (state == OCCUPIED))[29, 35:65])


def test_a_step_in_a_wall_is_followed_where_the_water_shows_it() -> None:
    state = np.full((60, 100), FREE, np.uint8)
    state[28:31, :50] = state[34:37, 50:] = OCCUPIED
    state[28:37, 48:51] = OCCUPIED
    truth = state.copy()
    state[27:38, 42:58] = np.where(state[27:38, 42:58] == OCCUPIED, UNKNOWN, FREE)
    cells = np.concatenate([each.cells for each in close_holes(state, 40.0, prior().hole)])
    assert np.all(truth[cells[:, 0], cells[:, 1]] == OCCUPIED)
    assert len(cells) >= 16


def test_mirrored_the_same_is_told() -> None:
    state = slab(slice(40, 55), halo=3)
    state[20:24, 60:70] = OCCUPIED
    plain, mirrored = (sorted(found(layer), key=lambda each: each.gap) for layer in (state, state[::-1, ::-1].copy()))
    assert len(plain) == len(mirrored)
    best, other = (max(each, key=chance) for each in (plain, mirrored))
    assert best.features == pytest.approx(other.features, abs=0.25)


def test_more_is_asked_of_what_may_be_a_way_through() -> None:
    hole = max(found(slab(slice(40, 55), halo=4)), key=chance)
    assert asked(hole, 0.25) >= 0.5
    dead_end = slab(slice(40, 55), halo=4)
    dead_end[:28] = UNKNOWN
    assert asked(max(found(dead_end), key=chance), 0.25) == 0.25


def test_of_ways_that_share_an_end_or_cross_the_best_set_is_taken() -> None:
    ways = found(slab(slice(40, 52)))
    taken = assign(ways, [chance(each) for each in ways])
    ends = [end for index in taken for end in ways[index].joined]
    assert len(ends) == len(set(ends))
    assert taken
