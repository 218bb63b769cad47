"""Filling the holes of an evidence grid: learn how far fills can be trusted here, close holes, lay them out."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from config.schema import Fill
from fill.certainty import Belief, hole_certainty
from fill.closing import Closed, close_holes, open_ends
from fill.lessons import learn
from fill.paper import paper_fill
from fill.prior import prior
from fill.values import Filled, Hole
from mapping.values import Grid


class Filler:
    """Fills holes; each call starts from the evidence alone, so that a fill new evidence denies is gone at once."""

    def __init__(self, config: Fill) -> None:
        self._config = config

    def update(self, grid: Grid) -> Filled:
        """Fill the holes of ``grid``: the same grid and configuration give the same fills."""
        longest = self._config.max_gap_m / grid.cell_m
        random = np.random.default_rng(self._config.seed)
        holes, left = (_chord_fill if self._config.method == "chord" else paper_fill)(grid, longest, random)
        return filled_grid(grid, holes, places_m(left, grid))


def _chord_fill(
    grid: Grid, longest: float, random: np.random.Generator
) -> tuple[tuple[Hole, ...], NDArray[np.float64]]:
    belief = learn(grid.state, longest, prior(), random)
    closed = close_holes(grid.state, longest, belief.hole)
    holes = tuple(_hole(index, each, belief, grid) for index, each in enumerate(closed))
    return holes, open_ends(grid.state, closed)


def filled_grid(grid: Grid, holes: tuple[Hole, ...], open_ends_m: NDArray[np.float64]) -> Filled:
    """Lay the holes out as layers beside the evidence."""
    certainty = np.zeros(grid.state.shape, np.float32)
    layer = np.full(grid.state.shape, -1, np.int32)
    for hole in holes:
        rows, cols = hole.cells.T
        certainty[rows, cols] = hole.certainty
        layer[rows, cols] = hole.index
    return Filled(grid, holes, certainty, layer, open_ends_m)


def places_m(cells: NDArray[np.float64], grid: Grid) -> NDArray[np.float64]:
    """Return places ``(n, 2)`` of x and y in the map, m, for places in cells."""
    return (cells + 0.5) * grid.cell_m + (grid.x0_m, grid.y0_m)


def _hole(index: int, closed: Closed, belief: Belief, grid: Grid) -> Hole:
    candidate = closed.candidate
    gap_m = candidate.gap * grid.cell_m
    return Hole(
        index=index,
        cells=closed.cells,
        certainty=belief.certainty(closed.chance, closed.away),
        hole_certainty=hole_certainty(closed.chance),
        ends_m=places_m(np.array([candidate.start, candidate.finish]), grid),
        gap_m=gap_m,
        curve=candidate.curve,
        why=_why(candidate.curve, gap_m, closed.chance),
    )


def _why(curve: str, gap_m: float, chance: float) -> str:
    shapes = {
        "line": "the wall goes on straight",
        "quadratic": "the wall goes on in one bend",
        "cubic": "the wall goes on in two bends",
        "tangent": "the wall turns",
        "corner": "two walls meet in a corner",
        "side": "the wall goes on to the side of another",
    }
    return f"{shapes[curve]} over {gap_m:.2f} m; right with {chance:.0%}"
