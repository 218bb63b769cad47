"""The paper's learning (Forrester et al. 2013, sections 3.1.1 and 3.1.2), by closed forms: how often fits hit.

Holes are taken out of every long segment, of every size up to a third of it and at every place; polynomials of order 1
to 3 through the cells on both sides are filled in, and each unit along the curve that falls on a cell which had been
occupied is a hit.  The cells are those of the segment's shortest way from endpoint to endpoint, and x and y are
polynomials of the steps along it, which the paper leaves open ("any standard approach to function approximation can be
used"): y as a function of x knows no wall along y.  Steps are alike in all holes of a size, and so is the matrix
that takes the cells seen to those missed: a hole costs a few products and no fit.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from fill.paper_fit import ORDERS

LEARNABLE: Final = 9
"""Steps of a segment that is long enough to learn from."""
_SHORTEST: Final = 3
_LONGEST: Final = 40  # steps: no longer hole is knocked out
_SIDES: Final = (10, 6, 3)  # cells seen on either side of a hole: as many as a segment has
_MARGIN: Final = 64  # cells about the grid where a fit may run and hits nothing
_AT_ONCE: Final = 4096
_ENOUGH: Final = 20_000  # holes of one size: more teach nothing new

Cells = NDArray[np.int64]
Layer = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Tally:
    """Filled cells of knocked-out holes: ``count`` and ``hits`` ``(3, n)`` int64 by order and distance in cells."""

    count: Cells
    hits: Cells

    @property
    def holes(self) -> int:
        """Return the number of holes told by closed forms: each has two cells one step from its ends."""
        return int(self.count[0, 1]) // 2

    @property
    def positives(self) -> float:
        """Share of filled cells that had been occupied, as in the paper's Table 1; nan without any."""
        total = int(self.count.sum())
        return int(self.hits.sum()) / total if total else float("nan")


def learn(paths: Sequence[Cells], wall: NDArray[np.bool_], random: np.random.Generator) -> Tally:
    """Knock holes into ``paths``, cells ``(n, 2)`` from endpoint to endpoint in ``wall`` ``(rows, cols)``."""
    bins = _LONGEST // 2 + 2
    tally = Tally(np.zeros((len(ORDERS), bins), np.int64), np.zeros((len(ORDERS), bins), np.int64))
    lengths = np.array([len(path) for path in paths], np.int64)
    if not len(lengths):
        return tally
    ground = _Ground(np.concatenate(paths), wall)
    first = np.cumsum(lengths) - lengths
    for size in range(_SHORTEST, min(int(lengths.max() - 1) // 3, _LONGEST) + 1):
        away = np.minimum(np.arange(1, size + 1), np.arange(size, 0, -1))
        for side, starts in _starts(lengths, first, size):
            chosen = starts if len(starts) <= _ENOUGH else np.sort(random.choice(starts, _ENOUGH, replace=False))
            hits = ground.hits(chosen, side, size)
            for order in range(len(ORDERS)):
                tally.count[order] += np.bincount(away, minlength=bins) * len(chosen)
                tally.hits[order] += np.bincount(away, hits[order], minlength=bins).astype(np.int64)
    return tally


def _starts(lengths: Cells, first: Cells, size: int) -> Iterator[tuple[int, Cells]]:
    """Yield where windows of so many cells on both sides of a hole begin; each path is in one turn alone."""
    left = (lengths > LEARNABLE) & (lengths - 1 >= 3 * size)
    for side in _SIDES:
        room = np.where(left, lengths - 2 * side - size + 1, 0)
        fits = room > 0
        left &= ~fits
        count = room[fits]
        if len(count):
            turn = np.arange(int(count.sum())) - np.repeat(np.cumsum(count) - count, count)
            yield side, np.repeat(first[fits], count) + turn


class _Ground:
    """Where fits may hit: walls with a margin about them, and the ways along them, in single precision."""

    def __init__(self, places: Cells, wall: NDArray[np.bool_]) -> None:
        padded = np.pad(wall, _MARGIN).astype(np.float32)
        self._flat, self._width = padded.ravel(), padded.shape[1]
        # Half a cell more, so that cutting off decimals rounds: polynomials go through what is added to all.
        self._rows, self._cols = np.ascontiguousarray((places + _MARGIN + 0.5).T, np.float32)

    def hits(self, starts: Cells, side: int, size: int) -> Layer:
        """Count for each order how often ``(orders, size)`` each of a hole's cells is hit."""
        seen, missed = _bases(side, size)
        hits = np.zeros((len(ORDERS), size))
        for turn in range(0, len(starts), _AT_ONCE):
            part = starts[turn : turn + _AT_ONCE]
            rows, cols = (sliding_window_view(each, len(seen))[part] @ seen for each in (self._rows, self._cols))
            for order in ORDERS:
                row = (rows[:, : order + 1] @ missed[: order + 1]).astype(np.int32)
                col = (cols[:, : order + 1] @ missed[: order + 1]).astype(np.int32)
                row *= self._width
                row += col
                hits[order - 1] += np.ones(len(part), np.float32) @ self._flat.take(row, mode="clip")
        return hits


def _bases(side: int, size: int) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Polynomials ``(cells, 4)`` that are orthonormal over the cells seen, 0 in the hole; the same in the hole."""
    steps = (np.arange(2 * side + size) - (2 * side + size - 1) / 2.0) / side
    powers = np.vander(steps, max(ORDERS) + 1, increasing=True)
    hole = slice(side, side + size)
    around = np.delete(powers, np.s_[hole], axis=0)
    change = np.linalg.inv(np.linalg.qr(around).R)
    seen = powers @ change
    missed = seen[hole].T.astype(np.float32)
    seen[hole] = 0.0
    return seen.astype(np.float32), missed
