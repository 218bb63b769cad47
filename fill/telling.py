"""Telling how sure fills are: witnesses heard, certainties worked out, parents found."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fill.certainty import Belief
from fill.closing import Closed
from fill.recent import Recent
from fill.values import Hole
from fill.witness import SEEN, distances, witness
from mapping.values import Grid

_SHAPES: Final = {
    "line": "the wall goes on straight",
    "quadratic": "the wall goes on in one bend",
    "cubic": "the wall goes on in two bends",
    "tangent": "the wall turns",
    "corner": "two walls meet in a corner",
    "side": "the wall goes on to the side of another",
}


@dataclass(frozen=True, slots=True)
class Heard:
    """What speaks for a fill: ``log_odds`` ``(n,)`` of its cells, their distances ``(n,)``, and whether it is new."""

    log_odds: NDArray[np.float64]
    away: NDArray[np.float64]
    beyond: bool


def heard(closed: Closed, state: NDArray[np.uint8], belief: Belief, recent: Recent) -> Heard:
    """Hear the witnesses of one fill, anew only where something about it changed."""
    low = np.maximum(np.minimum(closed.cells.min(axis=0), closed.candidate.path.min(axis=0)) - _reach(closed), 0)
    high = np.maximum(closed.cells.max(axis=0), closed.candidate.path.max(axis=0)) + _reach(closed) + 1
    window = state[low[0] : high[0], low[1] : high[1]]
    drawn = closed.candidate, closed.cells.tobytes(), closed.away.tobytes(), closed.chance, closed.rivals
    key = (tuple(low.tolist()), window.shape, window.tobytes(), drawn)
    return recent.recall(key, lambda: _hear(closed, state, belief))


def tell(
    closed: Sequence[Closed], told: Sequence[Heard], belief: Belief, grid: Grid, ends_m: NDArray[np.float64]
) -> tuple[Hole, ...]:
    """Make holes of fills; ``ends_m`` ``(n, 2, 2)``.  A fill is never surer than those that it goes on from."""
    owner = np.full(grid.state.shape, -1, np.int32)
    holes: list[Hole] = []
    for index, (each, witnessed) in enumerate(zip(closed, told, strict=True)):
        parents = tuple(p for p in _parents(each, owner) if closed[p].candidate is not each.candidate)
        certainty = belief.certainty(witnessed.log_odds, witnessed.away)
        whole = belief.hole_certainty(certainty)
        for parent in parents:
            certainty = np.minimum(certainty, holes[parent].certainty.min())
            whole = min(whole, holes[parent].hole_certainty)
        gap_m = each.candidate.gap * grid.cell_m
        holes.append(
            Hole(
                index, each.cells, certainty, whole, ends_m[index], gap_m, each.candidate.curve,
                _why(each.candidate.curve, gap_m, whole, witnessed.beyond), parents, witnessed.beyond,
            )
        )  # fmt: skip
        owner[each.cells[:, 0], each.cells[:, 1]] = index
    return tuple(holes)


def _hear(closed: Closed, state: NDArray[np.uint8], belief: Belief) -> Heard:
    features, cells = witness(closed, state)
    return Heard(belief.cell.log_odds(features, cells), distances(closed, cells), belief.cell.excess(features) > 0.0)


def _reach(closed: Closed) -> int:
    """Cells about a fill that its witnesses look at."""
    return SEEN + int(closed.candidate.gap) + int(max(closed.candidate.half_a, closed.candidate.half_b))


def _parents(closed: Closed, owner: NDArray[np.int32]) -> tuple[int, ...]:
    """Holes whose fills lie next to this one or in the walls that gave it its direction."""
    lines = np.concatenate([end.line for end in closed.candidate.ends])[:, ::-1]
    near = np.concatenate([np.rint(lines).astype(np.int64), closed.candidate.path.astype(np.int64)])
    rows, cols = np.clip(near, 0, np.array(owner.shape) - 1).T
    met = owner[rows, cols]
    return tuple(np.unique(met[met >= 0]).tolist())


def _why(curve: str, gap_m: float, chance: float, beyond: bool) -> str:
    unlike = ", longer than any hole learnt from" if beyond else ""
    return f"{_SHAPES.get(curve, curve)} over {gap_m:.2f} m; right with {chance:.0%}{unlike}"
