"""Certainties: clamped, falling with distance, no surer than their parents, and marked beyond what was learnt."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from config.schema import Fill
from fill.certainty import DESIGN, HIGHEST, LOWEST, falling
from fill.filler import Filler
from fill.knockout import EXAMS, knock_out, places, window
from fill.lessons import Lesson, taught
from fill.prior import prior
from fill.witness import HOLE_FEATURES
from mapping.values import FREE, OCCUPIED, UNKNOWN, Grid

Floats = NDArray[np.float64]
numbers = st.floats(0.0, 1.0)


@given(st.lists(st.tuples(numbers, st.floats(0.0, 30.0)), min_size=1, max_size=40))
def test_what_falls_never_grows_and_keeps_its_mean(cells: list[tuple[float, float]]) -> None:
    chance, away = np.array(cells).T
    fallen = falling(chance, away)
    assert np.all(np.diff(fallen[np.argsort(away, kind="stable")]) <= 1e-9 + (np.diff(np.sort(away)) == 0))
    assert fallen.mean() == pytest.approx(chance.mean())
    assert np.allclose(falling(fallen, away), fallen)


def test_certainties_keep_within_their_bounds_however_odd_the_features() -> None:
    belief = prior()
    random = np.random.default_rng(1)
    hole = random.normal(0.0, 100.0, len(HOLE_FEATURES))
    cells = random.normal(0.0, 100.0, (50, len(DESIGN) - len(HOLE_FEATURES)))
    (certainty,) = belief.certainties([belief.cell.log_odds(hole, cells)], [np.arange(50.0)])
    assert np.all((certainty >= np.float32(LOWEST)) & (certainty <= np.float32(HIGHEST)))
    assert LOWEST <= belief.hole_certainties([certainty])[0] <= HIGHEST


def test_beyond_the_longest_learnt_gap_less_is_told_the_longer_it_is() -> None:
    cell = prior().cell
    hole = np.zeros(len(HOLE_FEATURES))
    gap = HOLE_FEATURES.index("log gap")
    told = []
    for more in (0.0, 0.5, 1.0, 2.0):
        hole[gap] = cell.longest + more
        told.append(cell.damped(hole))
    assert told[0] == 1.0
    assert told == sorted(told, reverse=True)
    assert told[-1] < 0.3


def wide_gap(cells: int) -> Grid:
    """Two long straight walls in line with water on one side, and ``cells`` between them that nobody saw."""
    state = np.full((80, 160 + cells), UNKNOWN, np.uint8)
    state[30:33, 10:-10] = OCCUPIED
    state[33:70, 10:-10] = FREE
    state[20:50, 80 : 80 + cells] = UNKNOWN
    return Grid(0.05, 0.0, 0.0, np.zeros(state.shape, np.float32), state)


def test_a_gap_like_those_learnt_is_not_marked_and_a_far_longer_one_would_be() -> None:
    (near,), (far,) = (Filler(Fill(max_gap_m=8.0)).update(wide_gap(cells)).holes for cells in (12, 110))
    assert not near.beyond_learnt
    assert far.beyond_learnt
    assert "longer than any" in far.why
    assert far.hole_certainty < near.hole_certainty


def test_a_fill_is_no_surer_than_those_it_goes_on_from() -> None:
    random = np.random.default_rng(5)
    found = 0
    for _ in range(6):
        state = np.full((100, 140), UNKNOWN, np.uint8)
        state[20:80, 20:120] = OCCUPIED
        state[22:78, 22:118] = FREE
        for row, col in zip(random.choice([20, 79], 14), random.integers(20, 118, 14), strict=True):
            state[row - 3 : row + 4, col : col + random.integers(3, 9)] = UNKNOWN
        holes = Filler(Fill()).update(Grid(0.05, 0.0, 0.0, np.zeros(state.shape, np.float32), state)).holes
        for hole in holes:
            for parent in hole.parents:
                found += 1
                assert parent < hole.index
                assert hole.certainty.max() <= holes[parent].certainty.min()
                assert hole.hole_certainty <= holes[parent].hole_certainty
    assert found


def test_lessons_move_the_site_and_no_further_than_sites_differ() -> None:
    belief = prior()
    told = np.full(40, 2.0)
    worse = taught(belief, [Lesson(7, False, told, np.zeros(40, bool))] * 5, [7.0])
    better = taught(belief, [Lesson(7, False, told, np.ones(40, bool))] * 5, [7.0])
    assert worse.site.weights @ (1.0, 2.0) < 2.0 < better.site.weights @ (1.0, 2.0)
    assert worse.site.weights[1] > 0.0
    assert taught(belief, [], []) is belief


def test_exams_stay_where_they_are_when_the_grid_grows() -> None:
    centre = np.zeros((150, 200), bool)
    centre[40, 10:190] = centre[10:140, 100] = True
    here = places(centre, (0, 0))
    grown = places(np.pad(centre, ((5, 9), (7, 3))), (-5, -7))
    assert 0 < len(here) <= EXAMS
    assert {each.number for each in here} == {each.number for each in grown}


def test_an_exam_takes_wall_or_the_water_of_an_opening_and_nothing_else() -> None:
    state = wide_gap(0).state
    centre = np.zeros(state.shape, bool)
    centre[31, 10:-10] = True
    held = 0
    for place in places(centre, (3, 4)):
        cut = window(place, state)
        exam = knock_out(cut, place)
        if exam is not None:
            held += 1
            changed = exam.state != cut
            assert changed.any()
            assert np.all(exam.state[changed] == UNKNOWN)
    assert held
