"""The paper's method, as printed: what it can do, and what it cannot."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import ndimage

from fill.paper import paper_fill
from fill.paper_curve import CertaintyCurve, certainty_curves
from fill.paper_fit import best_fit, crossed, fit
from fill.paper_learning import LEARNABLE, Tally, learn
from fill.paper_loop import open_holes, raw_holes
from fill.paper_segments import find_paths, find_segments
from mapping.values import FREE, OCCUPIED, UNKNOWN, Grid

State = NDArray[np.uint8]


def room() -> State:
    state = np.full((60, 90), UNKNOWN, np.uint8)
    state[10:50, 10:80] = OCCUPIED
    state[13:47, 13:77] = FREE
    return state


def grid_of(state: State) -> Grid:
    return Grid(0.05, 0.0, 0.0, np.zeros(state.shape, np.float32), state)


def test_two_searches_find_the_ends_of_a_bent_line() -> None:
    mask = np.zeros((12, 20), bool)
    mask[2, 3:15] = True
    mask[2:9, 14] = True
    (segment,) = find_segments(mask, 4)
    ends = {tuple(segment.cells[index].tolist()) for index in (segment.first, segment.last)}
    assert ends == {(2, 3), (8, 14)}
    assert segment.length == 16  # corners are cut: every step costs one
    assert segment.from_first[segment.last] == segment.from_last[segment.first]


def test_short_segments_are_noise() -> None:
    mask = np.zeros((10, 30), bool)
    mask[2, 2:6] = True  # three steps
    mask[6, 2:7] = True
    assert [segment.length for segment in find_segments(mask, 4)] == [4]
    assert find_segments(np.zeros((0, 0), bool), 4) == []


def test_a_polynomial_of_its_order_is_found_again() -> None:
    cols = np.concatenate([np.arange(0, 10), np.arange(20, 30)])
    rows = np.rint(20 + 0.04 * (cols - 15) ** 2).astype(np.int64)
    samples = np.stack([rows, cols], axis=1)
    curve = fit(samples, 2, 60)
    wall = np.zeros((60, 40), bool)
    wall[rows, cols] = True
    found = crossed(curve, samples[9], samples[10], wall)
    true = 20 + 0.04 * (found.cells[:, 1] - 15) ** 2
    assert set(found.cells[:, 1]) >= set(range(10, 20))
    assert np.all(np.abs(found.cells[:, 0] - true) <= 1.0)
    assert found.away.max() == pytest.approx(5.3, abs=1.0)
    assert best_fit(samples, 60).error <= min(fit(samples, order, 60).error for order in (1, 2, 3))


def test_a_gap_along_x_is_filled_and_the_same_gap_along_y_is_not() -> None:
    along_x = np.full((40, 60), UNKNOWN, np.uint8)
    along_x[20, 5:25] = along_x[20, 33:55] = OCCUPIED
    (hole,) = raw_holes(along_x, 12)
    assert hole.cells.tolist() == [[20, col] for col in range(25, 33)]
    assert hole.away.max() == pytest.approx(4.25, abs=0.6)
    along_y = np.ascontiguousarray(along_x.T)
    cells = [cell for hole in raw_holes(along_y, 12) for cell in hole.cells.tolist()]
    assert len([cell for cell in cells if cell[1] == 20]) < 8  # y as a function of x: the wall is no such function


def test_an_open_door_is_walled_up_as_printed_and_left_open_by_the_program() -> None:
    state = room()
    state[5:13, 40:50] = FREE
    assert any(np.any(state[hole.cells[:, 0], hole.cells[:, 1]] == FREE) for hole in raw_holes(state, 40))
    holes, _ = open_holes(state, 40)
    assert all(np.all(state[hole.cells[:, 0], hole.cells[:, 1]] == UNKNOWN) for hole in holes)


@pytest.mark.parametrize("upright", [False, True])
def test_knock_outs_of_a_straight_wall_are_all_hits_whichever_way_it_runs(upright: bool) -> None:
    wall = np.zeros((80, 80), bool)
    wall[15, 5:75] = True
    wall = wall.T if upright else wall
    tally = learn(find_paths(wall, LEARNABLE), wall, np.random.default_rng(1))
    assert tally.positives == 1.0
    assert tally.count.sum() > 1000
    assert np.allclose(certainty_curves(tally)[1].certainty(np.array([0.5, 3.0, 50.0])), 1.0)


def test_closed_forms_hit_what_fits_hit() -> None:
    path = np.stack([np.rint(8.0 * np.sin(np.arange(60) / 7.0)) + 20.0, np.arange(60.0) + 4.0], axis=1).astype(np.int64)
    wall = np.zeros((40, 70), bool)
    wall[path[:, 0], path[:, 1]] = True
    tally = learn([path], wall, np.random.default_rng(1))
    count, hits = 0, np.zeros(3, np.int64)
    for size in range(3, 20):
        for start in range(len(path) - 20 - size + 1):
            seen = np.r_[start : start + 10, start + 10 + size : start + 20 + size]
            missed = np.arange(start + 10, start + 10 + size)
            count += size
            for order in (1, 2, 3):
                row, col = (np.rint(np.polyval(np.polyfit(seen, path[seen, at], order), missed)) for at in (0, 1))
                hits[order - 1] += wall[row.astype(np.int64), col.astype(np.int64)].sum()
    assert tally.count.sum(axis=1).tolist() == [count] * 3
    assert np.all(np.abs(tally.hits.sum(axis=1) - hits) <= 0.01 * count)  # halves are rounded either way


def test_ways_from_end_to_end_are_the_shortest() -> None:
    mask = np.zeros((12, 20), bool)
    mask[2:4, 3:15] = True
    mask[2:9, 14] = True
    mask[2, 10] = False
    (path,) = find_paths(mask, 4)
    assert len(path) == find_segments(mask, 4)[0].length + 1
    assert np.abs(np.diff(path, axis=0)).max() == 1
    assert mask[path[:, 0], path[:, 1]].all()


def test_the_curve_is_held_beyond_its_last_bin_and_kept_within_0_and_1() -> None:
    count = np.tile([0, 0, 0, 0, 0, 0], (3, 1))
    count[1, :5] = 20
    hits = np.zeros_like(count)
    hits[1, :5] = [20, 18, 12, 9, 2]
    curve = certainty_curves(Tally(count, hits))[2]
    beyond = curve.certainty(np.array([4.5, 10.0, 100.0]))
    assert np.all(beyond == beyond[0])
    assert curve.certainty(np.array([0.5]))[0] == pytest.approx(1.0, abs=0.05)
    assert np.all(CertaintyCurve(np.array([2.0]), 0.0, 1.0).certainty(np.arange(3.0)) == 1.0)


def test_holes_are_whole_touch_nothing_measured_and_come_out_the_same() -> None:
    state = room()
    state[8:14, 20:30] = UNKNOWN
    state[44:52, 50:58] = UNKNOWN
    holes, left = paper_fill(grid_of(state), 30.0, np.random.default_rng(1))
    assert holes
    for hole in holes:
        assert np.all(state[hole.cells[:, 0], hole.cells[:, 1]] == UNKNOWN)
        layer = np.zeros(state.shape, bool)
        layer[hole.cells[:, 0], hole.cells[:, 1]] = True
        assert ndimage.label(layer, np.ones((3, 3)))[1] == 1
        assert 0.0 < hole.hole_certainty <= hole.certainty.min() + 1e-6
    again, left_again = paper_fill(grid_of(state), 30.0, np.random.default_rng(1))
    assert [hole.cells.tobytes() for hole in again] == [hole.cells.tobytes() for hole in holes]
    assert left_again.tolist() == left.tolist()


@pytest.mark.parametrize("shape", [(0, 0), (1, 1), (2, 9)])
@pytest.mark.parametrize("value", [UNKNOWN, FREE, OCCUPIED])
def test_tiny_grids_give_no_hole(shape: tuple[int, int], value: int) -> None:
    holes, _ = paper_fill(grid_of(np.full(shape, value, np.uint8)), 40.0, np.random.default_rng(1))
    assert holes == ()
