"""Closing holes, smallest first: ends are found, matched and joined, and what was joined helps the next larger gap."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from fill.candidates import Candidate
from fill.freedom import capped
from fill.matching import asked, assign, candidates, gain
from fill.memory import Memory
from fill.recalling import chances_of
from fill.segments import EIGHT, End, Walls
from fill.settling import settled
from mapping.trees import Trees
from mapping.values import OCCUPIED, UNKNOWN

THRESHOLD: Final = 0.3
"""A fill less likely right than this is not drawn: the end stays open."""
_MOST_ENDS: Final = 1500
_ONE_END: Final = 0.3  # log-odds: of two ways as likely, that is taken which leaves no end open
_SMALL: Final = 12.0  # cells: gaps that are closed before any larger one is looked at


@dataclass(frozen=True, slots=True)
class Closed:
    """A hole that was closed.

    ``cells`` ``(n, 2)`` int32 were unknown and became wall, ``away`` ``(n,)`` float64 is each one's distance from the
    nearer end in cells, ``chance`` the probability that the candidate is right, ``rivals`` the other
    candidates of the same ends, with their chances.
    """

    candidate: Candidate
    cells: NDArray[np.int32]
    away: NDArray[np.float64]
    chance: float
    rivals: tuple[tuple[Candidate, float], ...] = ()


def close_holes(
    state: NDArray[np.uint8], longest: float, model: Trees, threshold: float = THRESHOLD,
    memory: Memory | None = None,
) -> list[Closed]:  # fmt: skip
    """Close the holes of ``state`` ``(rows, cols)`` up to ``longest`` cells; ``memory`` spares work done before."""
    memory = memory or Memory()
    wall = state == OCCUPIED
    closed: list[Closed] = []
    for reach in _rounds(longest):
        found = candidates(open_walls(wall, state, memory), state, reach, memory)
        closed += _close_round(found, model, threshold, state, wall, memory)
    return closed


def left_open(
    state: NDArray[np.uint8], closed: list[Closed], memory: Memory | None = None
) -> tuple[NDArray[np.float64], int]:
    """Return the ends of walls ``(n, 2)``, x and y in cells, that are still open with these holes closed.

    The second is how many ends were not looked at, since they are more than any site has: noise.
    """
    wall = state == OCCUPIED
    for each in closed:
        wall[each.cells[:, 0], each.cells[:, 1]] = True
    walls = _uncapped(wall, state, memory or Memory())
    ends = _longest(walls.ends)
    noise = len(walls.ends) - len(ends) + int(np.count_nonzero(walls.noise))
    return np.array([(end.x, end.y) for end in ends]).reshape(-1, 2), noise


def open_walls(wall: NDArray[np.bool_], state: NDArray[np.uint8], memory: Memory | None = None) -> Walls:
    """Find the walls, and of their ends those that were not seen to be the end."""
    walls = _uncapped(wall, state, memory or Memory())
    return dataclasses.replace(walls, ends=_longest(walls.ends))


def _uncapped(wall: NDArray[np.bool_], state: NDArray[np.uint8], memory: Memory) -> Walls:
    walls = memory.walls(wall, state)
    ends = (end for end, shut in zip(walls.ends, capped(walls.ends, state).tolist(), strict=True) if not shut)
    return dataclasses.replace(walls, ends=tuple(ends))


def _longest(ends: tuple[End, ...]) -> tuple[End, ...]:
    """Keep the ends of the longest walls where there are more than any site has: such a grid is noise for the most."""
    if len(ends) <= _MOST_ENDS:
        return ends
    kept = sorted(range(len(ends)), key=lambda index: (-ends[index].length, index))[:_MOST_ENDS]
    return tuple(ends[index] for index in sorted(kept))


def _close_round(
    found: list[Candidate], model: Trees, threshold: float, state: NDArray[np.uint8], wall: NDArray[np.bool_],
    memory: Memory,
) -> list[Closed]:  # fmt: skip
    """Take the best candidates, and mark their cells in ``wall``."""
    if not found:
        return []
    chances = chances_of(found, model, memory)
    gains = [0.0] * len(found)  # what is less likely than the threshold is worth nothing
    for index in np.flatnonzero(chances > threshold).tolist():
        gains[index] = gain(float(chances[index]), asked(found[index], threshold)) - _ONE_END * found[index].side
    taken = assign(found, gains)
    by_end = _by_end(found, {end for index in taken for end in found[index].joined})
    closed: list[Closed] = []
    for index in taken:
        rivals = _rivals(index, found, by_end, chances)
        best = settled(found[index], state, memory)
        for cells, away in _stretches(best, state, wall, memory):
            closed.append(Closed(best, cells, away, float(chances[index]), rivals))
            wall[cells[:, 0], cells[:, 1]] = True
    return closed


def _by_end(found: list[Candidate], ends: set[End]) -> dict[End, list[int]]:
    """Return for each of some ends the candidates that it has."""
    indices: dict[End, list[int]] = {end: [] for end in ends}
    for index, each in enumerate(found):
        for end in each.joined:
            if end in ends:
                indices[end].append(index)
    return indices


def _rivals(
    taken: int, found: list[Candidate], by_end: dict[End, list[int]], chances: NDArray[np.float64]
) -> tuple[tuple[Candidate, float], ...]:
    """Return the other candidates of the same ends, with their chances."""
    shared = sorted({index for end in found[taken].joined for index in by_end[end]} - {taken})
    return tuple((found[index], float(chances[index])) for index in shared)


def _rounds(longest: float) -> Iterator[float]:
    """Small gaps first: what closes them gives shape to the walls that large ones are closed between."""
    if longest > _SMALL:
        yield _SMALL
    yield longest


def _away(cells: NDArray[np.int32], candidate: Candidate) -> NDArray[np.float64]:
    ends = np.array([candidate.start, candidate.finish])[:, ::-1]
    return np.asarray(np.hypot(*(cells[None] - ends[:, None]).transpose(2, 0, 1)).min(axis=0), np.float64)


def fill_cells(candidate: Candidate, state: NDArray[np.uint8], wall: NDArray[np.bool_]) -> list[NDArray[np.int32]]:
    """Unknown cells ``(n, 2)`` that the fill takes: its path, and about it the thickness of the walls it joins.

    Where measured wall stands in between, each stretch of the fill comes by itself.
    """
    low, open_here = _room(candidate, state, wall)
    return _taken(candidate, low, open_here)


def _stretches(
    candidate: Candidate, state: NDArray[np.uint8], wall: NDArray[np.bool_], memory: Memory
) -> list[tuple[NDArray[np.int32], NDArray[np.float64]]]:
    """Return cells as ``fill_cells`` does, and how far each is from the nearer end."""
    low, open_here = _room(candidate, state, wall)

    def made() -> list[tuple[NDArray[np.int32], NDArray[np.float64]]]:
        return [(cells, _away(cells, candidate)) for cells in _taken(candidate, low, open_here)]

    return memory.recent(("cells", candidate.way, candidate.path.tobytes(), open_here.tobytes()), made)


def _room(
    candidate: Candidate, state: NDArray[np.uint8], wall: NDArray[np.bool_]
) -> tuple[NDArray[np.int32], NDArray[np.bool_]]:
    """Cells about a way that may be filled, and the row and column of the first."""
    margin = int(max(candidate.half_a, candidate.half_b)) + 2
    low = np.maximum(candidate.path.min(axis=0) - margin, 0)
    high = candidate.path.max(axis=0) + margin + 1
    window = slice(low[0], high[0]), slice(low[1], high[1])
    return low, (state[window] == UNKNOWN) & ~wall[window]


def _taken(candidate: Candidate, low: NDArray[np.int32], open_here: NDArray[np.bool_]) -> list[NDArray[np.int32]]:
    path = candidate.path
    rows, cols = (path - low).T
    bare = np.ones(open_here.shape, bool)
    bare[rows, cols] = False
    away, nearest = ndimage.distance_transform_edt(bare, return_indices=True)
    place = np.zeros(open_here.shape)
    place[rows, cols] = np.linspace(0.0, 1.0, len(path))
    share = place[nearest[0], nearest[1]]
    radius = candidate.half_a + share * (candidate.half_b - candidate.half_a) - 0.5
    taken = open_here & (away <= np.maximum(radius, 0.0) + 1e-9)
    parts, _ = ndimage.label(taken, EIGHT)
    on_path = np.unique(parts[rows, cols])
    return [(np.argwhere(parts == part) + low).astype(np.int32) for part in on_path[on_path > 0]]
