"""Telling how sure fills are: witnesses heard, certainties worked out, parents found."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fill.certainty import Belief
from fill.closing import Closed
from fill.memory import Basis, Memory
from fill.values import Hole
from fill.witness import SEEN, distances, witness
from mapping.values import Grid

_SHAPES: Final = {
    "line": "the wall goes on straight",
    "quadratic": "the wall goes on in one bend",
    "cubic": "the wall goes on in two bends",
    "tangent": "the wall turns",
    "corner": "two walls meet in a corner",
    "step": "the wall goes on, and steps over to the other",
    "shore": "the wall follows the edge of the water",
    "side": "the wall goes on to the side of another",
    "channel": "the wall runs between two waters",
}


@dataclass(frozen=True, slots=True)
class Heard:
    """What speaks for a fill: ``log_odds`` ``(n,)`` of its cells, their distances ``(n,)``, and whether it is new."""

    log_odds: NDArray[np.float64]
    away: NDArray[np.float64]
    beyond: bool


def heard(closed: Closed, state: NDArray[np.uint8], belief: Belief, memory: Memory) -> Heard:
    """Hear the witnesses of one fill, anew only where something about it changed."""
    rivals = tuple((rival.way, chance) for rival, chance in closed.rivals)
    drawn = closed.candidate.way, closed.candidate.features.tobytes(), closed.cells.tobytes(), closed.chance, rivals
    return memory.recall(("heard", drawn), lambda: (_about(closed), _hear(closed, state, belief)))


def tell(
    closed: Sequence[Closed], told: Sequence[Heard], belief: Belief, grid: Grid, ends_m: NDArray[np.float64]
) -> tuple[Hole, ...]:
    """Make holes of fills; ``ends_m`` ``(n, 2, 2)``.  A fill is never surer than those that it goes on from."""
    certainties = belief.certainties([each.log_odds for each in told], [each.away for each in told])
    wholes = belief.hole_certainties(certainties).tolist()
    parents = _parents(closed, grid.state.shape)
    holes: list[Hole] = []
    for index, (each, witnessed, certainty) in enumerate(zip(closed, told, certainties, strict=True)):
        whole = wholes[index]
        for parent in parents[index]:
            certainty = np.minimum(certainty, holes[parent].certainty.min())
            whole = min(whole, holes[parent].hole_certainty)
        gap_m = each.candidate.gap * grid.cell_m
        holes.append(
            Hole(
                index, each.cells, certainty, whole, ends_m[index], gap_m, each.candidate.curve,
                _why(each.candidate.curve, gap_m, whole, witnessed.beyond), parents[index], witnessed.beyond,
            )
        )  # fmt: skip
    return tuple(holes)


def _hear(closed: Closed, state: NDArray[np.uint8], belief: Belief) -> Heard:
    features, cells = witness(closed, state)
    return Heard(belief.cell.log_odds(features, cells), distances(closed, cells), belief.cell.excess(features) > 0.0)


def _about(closed: Closed) -> Basis:
    """Tell which cells about a fill its witnesses look at."""
    reach = SEEN + int(closed.candidate.gap) + int(max(closed.candidate.half_a, closed.candidate.half_b))
    both = np.concatenate([closed.cells, closed.candidate.path])
    low, high = (both.min(axis=0) - reach).tolist(), (both.max(axis=0) + reach + 1).tolist()
    return Basis((low[0], low[1], high[0], high[1]), walls=False)


def _parents(closed: Sequence[Closed], shape: tuple[int, ...]) -> list[tuple[int, ...]]:
    """Earlier holes whose fills lie next to each one or in the walls that gave it its direction."""
    parents: list[tuple[int, ...]] = [()] * len(closed)
    if not closed:
        return parents
    owner = np.full(shape, -1, np.int64)
    for index, each in enumerate(closed):
        owner[each.cells[:, 0], each.cells[:, 1]] = index
    near = [
        np.concatenate([each.candidate.path, *(end.line[:, ::-1] for end in each.candidate.ends)]) for each in closed
    ]
    rows, cols = np.clip(np.rint(np.concatenate(near)).astype(np.int64), 0, np.array(shape) - 1).T
    met, own = owner[rows, cols], np.repeat(np.arange(len(closed)), [len(each) for each in near])
    earlier = (met >= 0) & (met < own)
    for child, parent in np.unique(np.stack([own[earlier], met[earlier]], axis=1), axis=0).tolist():
        if closed[child].candidate is not closed[parent].candidate:
            parents[child] = *parents[child], parent
    return parents


def _why(curve: str, gap_m: float, chance: float, beyond: bool) -> str:
    unlike = ", longer than any hole learnt from" if beyond else ""
    return f"{_SHAPES.get(curve, curve)} over {gap_m:.2f} m; right with {chance:.0%}{unlike}"
