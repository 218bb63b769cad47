"""Filling the holes of an evidence grid: close them, learn on the site's own walls, tell how sure each fill is."""

from __future__ import annotations

import dataclasses
from functools import partial

import numpy as np
from numpy.typing import NDArray

from config.schema import Fill
from fill.certainty import Belief
from fill.closing import close_holes, left_open
from fill.knockout import places, window
from fill.lessons import hold, taught
from fill.memory import Memory
from fill.paper import paper_fill
from fill.prior import prior
from fill.recent import Recent
from fill.telling import heard, tell
from fill.values import Filled, Hole
from mapping.values import Grid


class Filler:
    """Fills holes; each call tells what the evidence alone says, so that a fill new evidence denies is gone at once.

    What did not change since the last call is not worked out again; what is told is the same as without that memory.
    """

    def __init__(self, config: Fill) -> None:
        self._config = config
        self._prior = prior()
        self._memory = Memory()
        self._exams = Recent()
        self._last: Filled | None = None
        self._seen = np.zeros((0, 0), np.uint8)

    def update(self, grid: Grid) -> Filled:
        """Fill the holes of ``grid``: the same grid and configuration give the same fills."""
        if self._last is None or not self._alike(self._last.grid, grid):
            longest = self._config.max_gap_m / grid.cell_m
            if self._config.method == "paper":
                holes, left = paper_fill(grid, longest, np.random.default_rng(self._config.seed))
                noise = 0
            else:
                holes, left, noise = self._chord_fill(grid, longest)
            self._last = filled_grid(grid, holes, places_m(left, grid), noise)
            self._seen = grid.state.copy()  # the caller may go on to draw in it
        return dataclasses.replace(self._last, grid=grid)

    def _alike(self, one: Grid, other: Grid) -> bool:
        places = ((each.cell_m, each.x0_m, each.y0_m) for each in (one, other))
        return len(set(places)) == 1 and np.array_equal(self._seen, other.state)

    def _chord_fill(self, grid: Grid, longest: float) -> tuple[tuple[Hole, ...], NDArray[np.float64], int]:
        for memory in (self._memory, self._exams):
            memory.begin()
        closed = close_holes(grid.state, longest, self._prior.hole, memory=self._memory)
        belief = self._school(grid, [each.candidate.gap for each in closed])
        told = [heard(each, grid.state, self._prior, self._memory) for each in closed]
        ends = [(each.candidate.start, each.candidate.finish) for each in closed]
        ends_m = places_m(np.array(ends).reshape(-1, 2, 2), grid)
        return tell(closed, told, belief, grid, ends_m), *left_open(grid.state, closed, self._memory)

    def _school(self, grid: Grid, gaps: list[float]) -> Belief:
        """Teach the prior by exams on the site's own walls; an exam whose window did not change is not held again."""
        corner = round(grid.y0_m / grid.cell_m), round(grid.x0_m / grid.cell_m)
        lessons = []
        for place in places(self._memory.measured.centre, corner):
            cut = window(place, grid.state)
            key = (place.middle, place.size, place.number, cut.shape, cut.tobytes())
            lessons.append(self._exams.recall(key, partial(hold, cut, place, self._prior)))
        return taught(self._prior, [each for each in lessons if each is not None], gaps)


def filled_grid(grid: Grid, holes: tuple[Hole, ...], open_ends_m: NDArray[np.float64], noise_ends: int = 0) -> Filled:
    """Lay the holes out as layers beside the evidence."""
    certainty = np.zeros(grid.state.shape, np.float32)
    layer = np.full(grid.state.shape, -1, np.int32)
    for hole in holes:
        rows, cols = hole.cells.T
        certainty[rows, cols] = hole.certainty
        layer[rows, cols] = hole.index
    return Filled(grid, holes, certainty, layer, open_ends_m, noise_ends)


def places_m(cells: NDArray[np.float64], grid: Grid) -> NDArray[np.float64]:
    """Return places ``(..., 2)`` of x and y in the map, m, for places in cells."""
    return (cells + 0.5) * grid.cell_m + (grid.x0_m, grid.y0_m)
