"""Where water was seen all along a hole, its edge tells where the wall stood: such a fill follows it.

Which walls belong together is judged by candidates (``matching``), and to these a curve that runs a cell beside the
wall is as good as the wall itself.  Here the way is drawn once more, as the cheapest one that keeps as far from water
as the two walls do.  It is taken where water was seen beside both walls up to their ends and along the whole of the
way, and where the way bends no more than a wall does: water that was lost with the wall has an edge as well, which
leaves the wall before its end, or goes round the hole.
"""

from __future__ import annotations

import dataclasses
import math
from typing import Final

import numpy as np
from numpy.typing import NDArray
from skimage.measure import approximate_polygon

from fill.candidates import Candidate
from fill.channels import cheapest, window
from fill.freedom import at, clear_path
from fill.memory import Basis, Box, Memory
from fill.segments import End, cell_at
from mapping.values import FREE, OCCUPIED

_BEHIND: Final = 8  # cells of centre line that tell how far from water a wall is
_DEEPEST: Final = 2.5  # cells beyond half its thickness: such a wall has no water at its side
_TIP: Final = 3  # cells behind an end
_BACK: Final = np.arange(-2.0, 12.0)[:, None] + 0.25  # from the face of an end
_STEP: Final = 0.5  # cells, beyond what the edge wavers by
_WAVERS: Final = 2.0  # standard deviations
_BEFORE: Final = 2  # of these places lie beyond the end
_TOLD: Final = 5  # places behind an end that tell where the edge is
_OUT: Final = np.arange(0.5, 8.0, 0.5)  # from a wall's axis: its face is met within
_SEEN_BACK: Final = 0.5
_SEEN_TIP: Final = 0.6
_EVEN: Final = 0.5  # cells: stairs
_PRICE: Final = 4.0  # of each cell that is nearer to water than the walls, or further off
_MOST: Final = 4.0
_HUGS: Final = 1.0  # cells off
_ALONG: Final = 0.9
_LONGEST: Final = 2.5  # times the gap; steps are counted edge to edge
_LONGER: Final = 4.0
_STAIRS: Final = 1.6  # cells that a way may leave a line and be straight
_LEG: Final = 6.0
_WINDING: Final = math.radians(70.0)
_SURE_WINDING: Final = math.radians(110.0)  # where water was seen beside all of both tips
_AROUND: Final = float(np.hypot(_BACK.max(), _OUT.max())) + 1.0

Layer = NDArray[np.float64]
State = NDArray[np.uint8]


def settled(candidate: Candidate, state: State, memory: Memory) -> Candidate:
    """Return the candidate on its way along the water's edge, or as it is where no such edge was seen.

    ``state`` ``(rows, cols)`` is what was measured.
    """

    def made() -> tuple[Basis, NDArray[np.int32] | None]:
        box = _looked_at(candidate, state.shape)
        return Basis(box, box, walls=False), edge_way(candidate, state, memory.water(state))

    path = memory.recall(("settled", candidate.way), made)
    if path is None:
        return candidate
    return dataclasses.replace(candidate, path=path)


def edge_way(candidate: Candidate, state: State, water: Layer) -> NDArray[np.int32] | None:
    """Cells ``(n, 2)`` of the way along the water's edge; None where no such edge was seen.

    ``water`` ``(rows, cols)`` is how far every cell is from water.
    """
    walls = candidate.joined
    depths = [_depth(end, water) for end in walls]
    if any(deep > end.half + _DEEPEST for end, deep in zip(walls, depths, strict=True)):
        return None
    told = [_beside(end, state) for end in walls]
    flanked = min(share for share, _ in told)
    if flanked < _SEEN_TIP or min(step for _, step in told) > _STEP:
        return None
    path = _hugging(candidate.ends, sum(depths) / len(depths), state, water)
    if path is None:
        return None
    return path if _winding(candidate, path) <= (_WINDING if flanked < 1.0 else _SURE_WINDING) else None


def _looked_at(candidate: Candidate, shape: tuple[int, ...]) -> Box:
    """Box of the cells that are asked for water."""
    a, b = candidate.ends
    low, high = window(a, b, math.hypot(b.x - a.x, b.y - a.y), shape)
    places = np.concatenate([np.array([(end.y, end.x)]) for end in candidate.joined])
    lines = [end.line[:_BEHIND, ::-1] for end in candidate.joined]
    first = np.minimum(low, np.min([places.min(axis=0) - _AROUND, *(line.min(axis=0) - 1.0 for line in lines)], axis=0))
    last = np.maximum(high, np.max([places.max(axis=0) + _AROUND, *(line.max(axis=0) + 2.0 for line in lines)], axis=0))
    return int(first[0]), int(first[1]), math.ceil(last[0]), math.ceil(last[1])


def _depth(end: End, water: Layer) -> float:
    """Mean distance of a centre line from water."""
    rows, cols = cell_at(end.line[:_BEHIND, ::-1]).T
    return float(np.mean(water[rows, cols]))


def _beside(end: End, state: State) -> tuple[float, float]:
    """Tell how water lies beside a wall's tip, on the worse of the sides where it was seen further back.

    Share of the tip with water next to it, and how much further from the wall's axis water begins beyond the tip
    than the edge wavers.
    """
    flanked, steps = [0.0], [0.0]
    for side in (1.0, -1.0):
        seen = at(state, end.x - _BACK * end.dx - side * _OUT * end.dy, end.y - _BACK * end.dy + side * _OUT * end.dx)
        beside = seen[np.arange(len(seen)), (seen != OCCUPIED).argmax(axis=1)] == FREE
        if beside[_BEFORE + _TIP :].mean() > _SEEN_BACK:
            free = seen == FREE
            edge = np.where(free.any(axis=1), _OUT[free.argmax(axis=1)], _OUT[-1])
            back = edge[_BEFORE:][beside[_BEFORE:]]
            flanked.append(float(beside[_BEFORE : _BEFORE + _TIP].mean()))
            steps.append(float(edge[:_BEFORE].mean() - back[:_TOLD].mean() - _WAVERS * back.std()))
    return min(flanked[1:], default=0.0), max(steps[1:], default=0.0)


def _hugging(ends: tuple[End, End], deep: float, state: State, water: Layer) -> NDArray[np.int32] | None:
    """Cells ``(n, 2)`` of the way between two ends that keeps ``deep`` cells from water; None where it cannot."""
    a, b = ends
    gap = math.hypot(b.x - a.x, b.y - a.y)
    low, high = window(a, b, gap, state.shape)
    here = water[low[0] : high[0], low[1] : high[1]]
    off = np.minimum(np.maximum(np.abs(here - deep) - _EVEN, 0.0), _MOST)
    cost = np.where(here <= 0.0, -1.0, 1.0 + _PRICE * off)
    found = cheapest(cost, a, b, low)
    path = None if found is None else clear_path(found.astype(np.int32), state)
    if path is None or len(path) > _LONGEST * gap + _LONGER:
        return None
    rows, cols = path.T
    lost = state[rows, cols] != OCCUPIED
    hugs = np.abs(water[rows, cols] - deep)[lost] <= _HUGS
    return path if len(hugs) and hugs.mean() >= _ALONG else None


def _winding(candidate: Candidate, path: NDArray[np.int32]) -> float:
    """Angle that a way turns to and fro, from the one wall to the other, beside what they are turned by."""
    a, b = candidate.ends
    legs = [np.array([[a.x - _LEG * a.dx, a.y - _LEG * a.dy], [a.x, a.y]]), path[1:-1, ::-1], np.array([[b.x, b.y]])]
    if not candidate.side:
        legs.append(np.array([[b.x - _LEG * b.dx, b.y - _LEG * b.dy]]))
    line = approximate_polygon(np.concatenate(legs), _STAIRS)  # type: ignore[no-untyped-call]
    steps = np.diff(line, axis=0)
    steps = steps[np.hypot(steps[:, 0], steps[:, 1]) > _EVEN]
    aims = np.arctan2(steps[:, 1], steps[:, 0])
    turns = (np.diff(aims) + math.pi) % math.tau - math.pi
    return float(np.abs(turns).sum() - abs(turns.sum()))
