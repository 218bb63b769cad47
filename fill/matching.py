"""Which ends belong together: candidates by distance, direction and shape, then one assignment.

Leaving an end open is a choice as well: a candidate must be likelier right than the threshold asks, and of
candidates that share an end or cross each other the set with the greatest gain is taken.  (The paper, section 3.2,
takes the lowest fitting error without a limit, so that in the end every end is matched to something.)
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from fill.candidates import FEATURES, Candidate, closer_partners
from fill.memory import Memory
from fill.recalling import recalled, ways_across, ways_onto_sides
from fill.scene import look
from fill.segments import End, Walls

_PARTNERS: Final = 8  # candidates of an end that are worth drawing
_WATER_BOTH: Final = FEATURES.index("water both")
_WET: Final = 0.05  # of the way has water on both sides
_PASSABLE: Final = 4.0  # cells; narrower gaps are no way through
_WAY_THROUGH: Final = 0.65  # of ways and holes that look alike, a way walled up is the greater loss
_EXACT: Final = 14  # up to so many candidates in conflict are solved exactly


def candidates(walls: Walls, state: NDArray[np.uint8], longest: float, memory: Memory | None = None) -> list[Candidate]:
    """Every way to close a hole of up to ``longest`` cells that no free water forbids."""
    memory = memory or Memory()
    scene = look(walls, state, memory.water(state))
    ends = walls.ends
    ways = [way for a, b in _pairs(walls, longest) for way in ways_across(ends[a], ends[b], scene, memory)]
    ways += [way for end in ends for way in ways_onto_sides(end, scene, longest, memory)]
    return recalled(ways, closer_partners(ways), scene, memory)


def assign(found: Sequence[Candidate], gains: Sequence[float]) -> list[int]:
    """Return the candidates to take: each end once, no crossings, the greatest sum of ``gains`` above 0."""
    live = [index for index, gain in enumerate(gains) if gain > 0]
    rivals = _rivals(live, found)
    taken: list[int] = []
    left = set(live)
    for index in live:
        if index in left:
            group = _group(index, rivals)
            left -= group
            taken += _best_set(sorted(group), rivals, gains)
    return sorted(taken)


def _pairs(walls: Walls, longest: float) -> list[tuple[int, int]]:
    """Pairs of ends that are near enough and look at each other; for each end the few most plausible."""
    ends = walls.ends
    if len(ends) < 2:
        return []
    places = np.array([(end.x, end.y) for end in ends])
    aims = np.array([(end.dx, end.dy) for end in ends])
    pairs = cKDTree(places).query_pairs(longest, output_type="ndarray")
    if not len(pairs):
        return []
    a, b = np.sort(pairs, axis=1).T
    apart = places[b] - places[a]
    gap = np.maximum(np.hypot(apart[:, 0], apart[:, 1]), 1.0)
    ahead_a = np.sum(apart * aims[a], axis=1) / gap
    ahead_b = -np.sum(apart * aims[b], axis=1) / gap
    # Over a few cells a direction is not known well: a slack of two cells is granted.
    slack = 2.0 / gap
    fits = (ahead_a + slack > -0.5) & (ahead_b + slack > -0.5) & (ahead_a + ahead_b + slack > -0.1)
    price = gap * (2.0 - np.minimum(ahead_a, 1.0)) * (2.0 - np.minimum(ahead_b, 1.0))
    order = np.flatnonzero(fits)[np.lexsort((b[fits], a[fits], price[fits]))]
    used = np.zeros(len(ends), np.int64)
    kept = []
    for pair in order:
        first, second = int(a[pair]), int(b[pair])
        if used[first] < _PARTNERS and used[second] < _PARTNERS:
            used[[first, second]] += 1
            kept.append((first, second))
    return kept


def _rivals(live: Sequence[int], found: Sequence[Candidate]) -> dict[int, set[int]]:
    """Return for each candidate those that share an end or a cell with it."""
    rivals: dict[int, set[int]] = {index: set() for index in live}
    if not rivals:
        return rivals
    by_end: dict[End, list[int]] = {}
    for index in live:
        for end in found[index].joined:
            by_end.setdefault(end, []).append(index)
    for claimants in {*map(tuple, by_end.values()), *_crossing(live, [found[index].path for index in live])}:
        for index in claimants:
            rivals[index].update(claimants)
    for index in live:
        rivals[index].discard(index)
    return rivals


def _crossing(live: Sequence[int], paths: Sequence[NDArray[np.int32]]) -> set[tuple[int, ...]]:
    """Return those of ``live`` that pass a cell together, for each such cell."""
    rows, cols = np.concatenate(paths).astype(np.int64).T
    owner = np.repeat(np.array(live, np.int64), [len(path) for path in paths])
    claims = np.unique(np.stack([rows * (int(cols.max()) + 1) + cols, owner], axis=1), axis=0)
    first = np.flatnonzero(np.diff(claims[:, 0], prepend=-1))
    last = np.append(first[1:], len(claims))
    several = last - first > 1
    owners: list[int] = claims[:, 1].tolist()
    return {tuple(owners[one:end]) for one, end in zip(first[several].tolist(), last[several].tolist(), strict=True)}


def _group(start: int, rivals: dict[int, set[int]]) -> set[int]:
    group, todo = {start}, [start]
    while todo:
        fresh = rivals[todo.pop()] - group
        group |= fresh
        todo += sorted(fresh)
    return group


def _best_set(group: list[int], rivals: dict[int, set[int]], gains: Sequence[float]) -> list[int]:
    """Return the heaviest set without conflicts: exact where the group is small, else heaviest first."""
    order = sorted(group, key=lambda index: (-gains[index], index))
    if len(order) > _EXACT:
        taken: list[int] = []
        for index in order:
            if rivals[index].isdisjoint(taken):
                taken.append(index)
        return taken
    return _branch(order, rivals, gains)[1]


def _branch(order: list[int], rivals: dict[int, set[int]], gains: Sequence[float]) -> tuple[float, list[int]]:
    if not order:
        return 0.0, []
    index, rest = order[0], order[1:]
    free = [other for other in rest if other not in rivals[index]]
    with_sum, with_set = _branch(free, rivals, gains)
    best = (gains[index] + with_sum, [index, *with_set])
    if len(free) == len(rest):
        return best
    without = _branch(rest, rivals, gains)
    return best if best[0] >= without[0] else without


def asked(candidate: Candidate, threshold: float) -> float:
    """Return how likely right a fill must be; more is asked where one could pass and water was seen on both sides."""
    wet = candidate.features[_WATER_BOTH] > _WET
    return max(threshold, _WAY_THROUGH) if wet and candidate.gap > _PASSABLE else threshold


def gain(chance: float, threshold: float) -> float:
    """Return what a fill of this chance is worth above staying open: log-odds above those of the threshold."""
    clipped = min(max(chance, 1e-6), 1.0 - 1e-6)
    return math.log(clipped / (1.0 - clipped)) - math.log(threshold / (1.0 - threshold))
