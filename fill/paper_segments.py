"""Segments and their two endpoints as the paper finds them (Forrester et al. 2013, section 3.2).

A segment is all occupied cells that touch, corners included.  Two searches of equal step cost give its endpoints: the
cell farthest from any cell is the first, the cell farthest from that the second.  Of cells equally far the one of the
lowest row, then column, is taken; the search starts at the segment's first cell by the same order.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import dijkstra

_EIGHT: Final = np.ones((3, 3), np.int8)
_ONWARD: Final = ((0, 1), (1, -1), (1, 0), (1, 1))  # each pair of neighbours once


@dataclass(frozen=True, slots=True)
class Segment:
    """Occupied cells that touch: ``cells`` ``(n, 2)`` int64 of row and column, in order.

    ``from_first``, ``from_last`` ``(n,)`` int64: steps from either endpoint, ``cells[first]`` and ``cells[last]``.
    """

    cells: NDArray[np.int64]
    from_first: NDArray[np.int64]
    from_last: NDArray[np.int64]
    first: int
    last: int

    @property
    def length(self) -> int:
        """Steps from endpoint to endpoint."""
        return int(self.from_first[self.last])


def find_segments(mask: NDArray[np.bool_], shortest: int) -> list[Segment]:
    """Segments of ``mask`` ``(rows, cols)`` at least ``shortest`` steps long, in order of their first cells."""
    nodes = np.flatnonzero(mask)
    if not len(nodes):
        return []
    part = np.asarray(ndimage.label(mask, _EIGHT)[0], np.int64).ravel()[nodes]
    graph = _graph(mask, nodes)
    _, starts = np.unique(part, return_index=True)
    first = _farthest(_steps(graph, starts), part)
    from_first = _steps(graph, first)
    last = _farthest(from_first, part)
    from_last = _steps(graph, last)
    order = np.argsort(part, kind="stable")
    bounds = np.searchsorted(part[order], np.arange(1, len(starts) + 2))
    cells = np.stack(np.divmod(nodes, mask.shape[1]), axis=1)
    found = []
    for number in np.flatnonzero(from_first[last] >= shortest):
        own = order[bounds[number] : bounds[number + 1]]
        places = (int(np.searchsorted(own, node)) for node in (first[number], last[number]))
        found.append(Segment(cells[own], from_first[own], from_last[own], *places))
    return found


def find_paths(mask: NDArray[np.bool_], shortest: int) -> list[NDArray[np.int64]]:
    """Return the shortest way from end to end of each such segment: cells ``(n, 2)`` of row and column."""
    nodes = np.flatnonzero(mask)
    if not len(nodes):
        return []
    part = np.asarray(ndimage.label(mask, _EIGHT)[0], np.int64).ravel()[nodes]
    graph = _graph(mask, nodes)
    first = _farthest(_steps(graph, np.unique(part, return_index=True)[1]), part)
    away, before, _ = dijkstra(
        graph, directed=False, indices=first, unweighted=True, min_only=True, return_predecessors=True
    )
    length = np.asarray(away, np.int64)
    last = _farthest(length, part)
    back: list[int] = before.tolist()
    rows, cols = np.divmod(nodes, mask.shape[1])
    cells = np.stack([rows, cols], axis=1)
    return [cells[_walked(int(node), back)] for node in last[length[last] >= shortest]]


def _walked(node: int, back: list[int]) -> list[int]:
    """Nodes from one to where its way began."""
    path = []
    while node >= 0:
        path.append(node)
        node = back[node]
    return path


def _graph(mask: NDArray[np.bool_], nodes: NDArray[np.int64]) -> csr_array:
    number = np.full((mask.shape[0] + 1, mask.shape[1] + 2), -1, np.int64)
    number[:-1, 1:-1][mask] = np.arange(len(nodes))
    here = number[:-1, 1:-1]
    pairs = []
    for down, right in _ONWARD:
        there = number[down : down + mask.shape[0], 1 + right : 1 + right + mask.shape[1]]
        both = (here >= 0) & (there >= 0)
        pairs.append(np.stack([here[both], there[both]]))
    start, finish = np.concatenate(pairs, axis=1)
    return csr_array(coo_array((np.ones(len(start), np.int8), (start, finish)), shape=(len(nodes), len(nodes))))


def _steps(graph: csr_array, sources: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the steps ``(n,)`` to every node from the source in its own segment."""
    away = dijkstra(graph, directed=False, indices=sources, unweighted=True, min_only=True)
    return np.asarray(away, np.int64)


def _farthest(away: NDArray[np.int64], part: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return of each segment the farthest node, of equals the first."""
    count = len(away)
    best = np.full(int(part.max()) + 1, -1, np.int64)
    np.maximum.at(best, part, away * count + np.arange(count)[::-1])
    return count - 1 - best[best >= 0] % count
