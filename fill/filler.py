"""Filling the holes of an evidence grid: learn how far fills can be trusted here, close holes, lay them out."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from config.schema import Fill
from fill.certainty import Belief
from fill.closing import Closed, close_holes, open_ends
from fill.knockout import places, window
from fill.lessons import hold, taught
from fill.paper import paper_fill
from fill.prior import prior
from fill.segments import find_walls
from fill.values import Filled, Hole
from fill.witness import distances, witness
from mapping.values import OCCUPIED, Grid


class Filler:
    """Fills holes; each call starts from the evidence alone, so that a fill new evidence denies is gone at once."""

    def __init__(self, config: Fill) -> None:
        self._config = config

    def update(self, grid: Grid) -> Filled:
        """Fill the holes of ``grid``: the same grid and configuration give the same fills."""
        longest = self._config.max_gap_m / grid.cell_m
        if self._config.method == "paper":
            holes, left = paper_fill(grid, longest, np.random.default_rng(self._config.seed))
        else:
            holes, left = _chord_fill(grid, longest)
        return filled_grid(grid, holes, places_m(left, grid))


def _chord_fill(grid: Grid, longest: float) -> tuple[tuple[Hole, ...], NDArray[np.float64]]:
    belief = prior()
    state = grid.state
    closed = close_holes(state, longest, belief.hole)
    corner = round(grid.y0_m / grid.cell_m), round(grid.x0_m / grid.cell_m)
    exams = [hold(window(each, state), each, belief) for each in places(find_walls(state == OCCUPIED).centre, corner)]
    belief = taught(belief, [each for each in exams if each], [each.candidate.gap for each in closed])
    return tuple(_holes(closed, belief, grid)), open_ends(state, closed)


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


def _holes(closed: list[Closed], belief: Belief, grid: Grid) -> list[Hole]:
    """Tell how sure each fill is, and no surer than those that it goes on from."""
    owner = np.full(grid.state.shape, -1, np.int32)
    holes: list[Hole] = []
    for index, each in enumerate(closed):
        parents = tuple(p for p in _parents(each, owner) if closed[p].candidate is not each.candidate)
        features, cells = witness(each, grid.state)
        certainty = belief.certainty(belief.cell.log_odds(features, cells), distances(each, cells))
        whole = belief.hole_certainty(certainty)
        for parent in parents:
            certainty = np.minimum(certainty, holes[parent].certainty.min())
            whole = min(whole, holes[parent].hole_certainty)
        holes.append(_hole(index, each, certainty, whole, parents, belief.cell.excess(features) > 0.0, grid))
        owner[tuple(each.cells.T)] = index
    return holes


def _parents(closed: Closed, owner: NDArray[np.int32]) -> tuple[int, ...]:
    """Holes whose fills lie next to this one or in the walls that gave it its direction."""
    ends = closed.candidate.ends
    lines = np.concatenate([each.line for each in ends])[:, ::-1]
    near = np.concatenate([np.rint(lines).astype(np.int64), closed.candidate.path.astype(np.int64)])
    near = np.clip(near, 0, np.array(owner.shape) - 1)
    return tuple(int(each) for each in np.unique(owner[tuple(near.T)]) if each >= 0)


def _hole(
    index: int, closed: Closed, certainty: NDArray[np.float32], whole: float, parents: tuple[int, ...], beyond: bool,
    grid: Grid,
) -> Hole:  # fmt: skip
    candidate = closed.candidate
    gap_m = candidate.gap * grid.cell_m
    return Hole(
        index=index,
        cells=closed.cells,
        certainty=certainty,
        hole_certainty=whole,
        ends_m=places_m(np.array([candidate.start, candidate.finish]), grid),
        gap_m=gap_m,
        curve=candidate.curve,
        why=_why(candidate.curve, gap_m, whole, beyond),
        parents=parents,
        beyond_learnt=beyond,
    )


def _why(curve: str, gap_m: float, chance: float, beyond: bool) -> str:
    shapes = {
        "line": "the wall goes on straight",
        "quadratic": "the wall goes on in one bend",
        "cubic": "the wall goes on in two bends",
        "tangent": "the wall turns",
        "corner": "two walls meet in a corner",
        "side": "the wall goes on to the side of another",
    }
    unlike = ", unlike any hole learnt from" if beyond else ""
    return f"{shapes.get(curve, curve)} over {gap_m:.2f} m; right with {chance:.0%}{unlike}"
