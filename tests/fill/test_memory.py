"""Filling again from memory: the same to the byte as filling from scratch, whatever changed in between."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from config.schema import Fill
from fill.filler import Filler
from fill.memory import Basis, Memory
from fill.recent import Recent
from fill.segments import find_walls
from fill.values import Filled
from mapping.values import FREE, OCCUPIED, UNKNOWN, Grid

State = NDArray[np.uint8]


def grid_of(state: State, x0_m: float = 0.0) -> Grid:
    return Grid(0.05, x0_m, 1.0, np.zeros(state.shape, np.float32), state)


def site() -> State:
    """Two rooms with a door between them, and a pillar."""
    state = np.full((70, 120), UNKNOWN, np.uint8)
    for cols in (slice(6, 58), slice(56, 112)):
        state[6:64, cols] = OCCUPIED
    for cols in (slice(8, 56), slice(58, 110)):
        state[8:62, cols] = FREE
    state[30:38, 56:58] = FREE
    state[20:24, 30:34] = OCCUPIED
    return state


def told(filled: Filled) -> bytes:
    parts = [filled.certainty.tobytes(), filled.hole.tobytes(), filled.open_ends_m.tobytes()]
    for hole in filled.holes:
        parts += [hole.cells.tobytes(), hole.certainty.tobytes(), hole.ends_m.tobytes()]
        parts.append(repr((hole.index, hole.hole_certainty, hole.gap_m, hole.curve, hole.why, hole.parents)).encode())
    return b"".join(parts)


changes = st.tuples(
    st.integers(0, 65), st.integers(0, 115), st.integers(1, 9), st.integers(1, 9),
    st.sampled_from([UNKNOWN, UNKNOWN, UNKNOWN, FREE, OCCUPIED]),
)  # fmt: skip


@settings(max_examples=4, deadline=None)
@given(passes=st.lists(st.lists(changes, min_size=1, max_size=3), min_size=2, max_size=3))
def test_from_memory_and_from_scratch_are_the_same_to_the_byte(
    passes: list[list[tuple[int, int, int, int, int]]],
) -> None:
    state = site()
    filler = Filler(Fill())
    filler.update(grid_of(state))
    for changed in passes:
        for row, col, rows, cols, value in changed:
            state[row : row + rows, col : col + cols] = value
        assert told(filler.update(grid_of(state))) == told(Filler(Fill()).update(grid_of(state)))


def test_a_grid_that_grew_or_moved_is_filled_as_if_it_were_new() -> None:
    state = site()
    state[5:9, 20:32] = UNKNOWN
    filler = Filler(Fill())
    filler.update(grid_of(state))
    for grid in (grid_of(np.pad(state, 3)), grid_of(state, 0.35), grid_of(state[10:, 4:])):
        assert told(filler.update(grid)) == told(Filler(Fill()).update(grid))


def test_nothing_flickers_when_nothing_changed() -> None:
    state = site()
    state[5:9, 20:32] = UNKNOWN
    filler = Filler(Fill())
    one = filler.update(grid_of(state))
    assert one.holes
    assert filler.update(grid_of(state.copy())).holes is one.holes


def test_a_fill_shrinks_and_goes_as_its_place_is_scanned() -> None:
    state = site()
    wall = state.copy()
    state[5:9, 20:40] = UNKNOWN
    filler = Filler(Fill())
    sizes = [len(filler.update(grid_of(state)).holes[0].cells)]
    for col in (25, 32):
        state[5:9, 20:col] = wall[5:9, 20:col]
        sizes.append(sum(len(hole.cells) for hole in filler.update(grid_of(state)).holes))
    state[5:9, 20:40] = wall[5:9, 20:40]
    assert sizes == sorted(sizes, reverse=True)
    assert filler.update(grid_of(state)).holes == ()


def test_walls_from_memory_are_the_walls() -> None:
    state = site()
    memory = Memory()
    random = np.random.default_rng(3)
    for _ in range(6):
        row, col = random.integers(0, 60), random.integers(0, 100)
        state[row : row + 7, col : col + 7] = UNKNOWN
        memory.begin()
        found, plain = memory.walls(state == OCCUPIED, state), find_walls(state == OCCUPIED)
        for layer in ("mask", "half", "centre"):
            assert np.array_equal(getattr(found, layer), getattr(plain, layer))
        assert len(found.ends) == len(plain.ends)
        assert np.array_equal(found.label > 0, plain.mask)


def test_results_hold_until_something_in_their_box_changes() -> None:
    state = np.full((60, 60), FREE, np.uint8)
    memory = Memory()
    made: list[int] = []

    def make() -> tuple[Basis, int]:
        made.append(len(made))
        return Basis((0, 0, 20, 20)), len(made)

    def passed() -> None:
        memory.begin()
        memory.walls(state == OCCUPIED, state)
        memory.recall("key", make)

    passed()
    state[50, 50] = OCCUPIED
    passed()
    assert made == [0]
    state[10, 10] = UNKNOWN
    passed()
    assert made == [0, 1]


def test_what_two_passes_did_not_ask_for_is_forgotten() -> None:
    recent = Recent()
    made = []
    for asked in (True, False, False, True):
        recent.begin()
        if asked:
            recent.recall("key", lambda: made.append(1))
    assert len(made) == 2
