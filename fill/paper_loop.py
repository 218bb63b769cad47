"""The paper's loop over a growing threshold (Forrester et al. 2013, section 3.2).

Where the text leaves a choice, the plain reading is taken: pairs are matched greedily by their error, each endpoint
once a round, without a limit to the error; filled cells count as occupied in the next round; both endpoints of one
segment may be matched where the way along the segment is much longer than the gap.  Rounds in which nothing could
change are passed over.  Free and unknown cells are not told apart: ``raw_holes`` walls up doors, as printed, and is
there for comparison alone.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from fill.paper_fit import Fit, best_fit, crossed
from fill.paper_segments import Segment, find_segments
from mapping.values import FREE, OCCUPIED

NEAR: Final = 10
"""Delta: cells so many steps from an endpoint are its sample points (not given in the paper)."""
_VALID: Final = 4
_FIRST_ROUND: Final = 2
_ROUND_TRIP: Final = 3.0  # a segment's way from end to end, in gaps, from which it may be closed onto itself

Fits = dict[tuple[bytes, bytes], Fit]


@dataclass(frozen=True, slots=True)
class PaperHole:
    """A hole as the paper fills it.

    ``ends`` ``(2, 2)`` int64 of row and column, ``order`` of the polynomial, ``cells`` ``(n, 2)`` int64, ``away``
    ``(n,)`` float64 arc length to the nearer endpoint in cells.
    """

    ends: NDArray[np.int64]
    order: int
    cells: NDArray[np.int64]
    away: NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Endpoint:
    """An endpoint: its cell, the sample points that belong to it ``(n, 2)``, its segment and that one's length."""

    cell: NDArray[np.int64]
    samples: NDArray[np.int64]
    segment: int
    length: int


def raw_holes(state: NDArray[np.uint8], longest: float) -> list[PaperHole]:
    """Fill ``state`` ``(rows, cols)`` as printed, over free water too."""
    return _loop(state == OCCUPIED, np.zeros(state.shape, bool), longest)[0]


def open_holes(state: NDArray[np.uint8], longest: float) -> tuple[list[PaperHole], NDArray[np.int64]]:
    """Fill ``state``, leaving out holes that would cross free water.

    Returns the holes, and the cells ``(n, 2)`` of endpoints that no hole took in the last round.
    """
    return _loop(state == OCCUPIED, state == FREE, longest)


def _loop(
    wall: NDArray[np.bool_], barred: NDArray[np.bool_], longest: float
) -> tuple[list[PaperHole], NDArray[np.int64]]:
    wall = wall.copy()
    holes: list[PaperHole] = []
    fits: Fits = {}
    ends, tried = endpoints(find_segments(wall, _VALID)), 0
    left = list(ends)
    for reach in range(_FIRST_ROUND, max(int(longest), _FIRST_ROUND) + 1):
        pairs = _pairs(ends, float(reach))
        if len(pairs) == tried:
            continue
        matched = _matched(pairs, ends, fits, len(wall))
        fresh = [hole for pair in matched if (hole := _hole(ends, pair, fits, wall, barred)) is not None]
        taken = {index for pair in matched for index in pair}
        left = [end for index, end in enumerate(ends) if index not in taken]
        tried = len(pairs)
        if fresh:
            for hole in fresh:
                wall[hole.cells[:, 0], hole.cells[:, 1]] = True
            holes += fresh
            ends, tried = endpoints(find_segments(wall, _VALID)), 0
    return holes, np.array([end.cell for end in left], np.int64).reshape(-1, 2)


def endpoints(segments: list[Segment]) -> list[Endpoint]:
    """Both endpoints of every segment, with the sample points of each (equation 4)."""
    found = []
    for number, each in enumerate(segments):
        for index, steps in ((each.first, each.from_first), (each.last, each.from_last)):
            found.append(Endpoint(each.cells[index], each.cells[steps < NEAR], number, each.length))
    return found


def _pairs(ends: list[Endpoint], reach: float) -> list[tuple[int, int]]:
    """Pairs of endpoints less than ``reach`` cells apart, in order."""
    if len(ends) < 2:
        return []
    cells = np.array([end.cell for end in ends])
    near = cKDTree(cells).query_pairs(reach, output_type="ndarray")
    found = []
    for a, b in np.sort(near, axis=1)[np.lexsort((near.max(axis=1), near.min(axis=1)))].tolist():
        gap = float(np.hypot(*(cells[a] - cells[b])))
        if gap < reach and (ends[a].segment != ends[b].segment or ends[a].length > _ROUND_TRIP * gap):
            found.append((a, b))
    return found


def _matched(pairs: list[tuple[int, int]], ends: list[Endpoint], fits: Fits, rows: int) -> list[tuple[int, int]]:
    """Pairs by the least error, each endpoint once."""
    ranked = sorted((_fit(ends, pair, fits, rows).error, pair) for pair in pairs)
    used: set[int] = set()
    taken = []
    for _, pair in ranked:
        if used.isdisjoint(pair):
            used.update(pair)
            taken.append(pair)
    return taken


def _fit(ends: list[Endpoint], pair: tuple[int, int], fits: Fits, rows: int) -> Fit:
    samples = ends[pair[0]].samples, ends[pair[1]].samples
    key = samples[0].tobytes(), samples[1].tobytes()
    if key not in fits:
        fits[key] = best_fit(np.concatenate(samples), rows)
    return fits[key]


def _hole(
    ends: list[Endpoint], pair: tuple[int, int], fits: Fits, wall: NDArray[np.bool_], barred: NDArray[np.bool_]
) -> PaperHole | None:
    """Return the hole between two endpoints; None where there is nothing to fill, or barred cells are in the way."""
    curve = _fit(ends, pair, fits, len(wall))
    first, last = ends[pair[0]].cell, ends[pair[1]].cell
    found = crossed(curve, first, last, wall)
    if not len(found.cells) or barred[found.cells[:, 0], found.cells[:, 1]].any():
        return None
    return PaperHole(np.stack([first, last]), curve.order, found.cells, found.away)
