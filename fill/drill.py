"""What a curve is worth on this site's walls: every stretch of every wall is taken out and fitted from both sides.

This is the paper's learning (section 3.1.2) at every place and many sizes at once.  A curve's parameter is the number
of the cell along its wall, and what least squares needs of the known cells are a few moments: worked out once for a
wall they serve every size and place, and a size is learnt by one product of matrices instead of a fit a hole.  Where
the ends are is told here; what detecting and matching add to the risk is learnt by examination (``lessons``).

Everything is a whole number of 2 to the minus 24, small enough that sums are exact: counts do not hang on which walls
were worked out together, and add up in any order.
"""

from __future__ import annotations

from functools import cache
from typing import Final

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from fill.segments import CentreLines, smooth

SIZES: Final = (3, 4, 5, 7, 9, 12, 16, 22, 30, 40)
"""Cells of the holes that are tried."""
BANDS: Final = 5
"""Distances from the nearer end, each twice as far as the one before: up to 1, 2, 4, 8 and more cells."""
_SIDE: Final = 8  # cells of wall on either side that tell the curve
_STRAIGHT_TO: Final = 8  # cells; a larger hole is given a bend
_HIT: Final = 1.0  # cells
_THIRD: Final = 3.0  # a smoothed line lies on thirds of a cell
_FINE: Final = 2.0**24
_AT_ONCE: Final = 16384  # numbers that stay in the processor's cache


def wall_lines(centre: NDArray[np.bool_]) -> list[NDArray[np.float64]]:
    """Follow centre lines ``(rows, cols)``: smoothed places ``(n, 2)`` of x and y, from tips and then round rings."""
    lines = CentreLines(np.pad(centre, 1))
    todo = dict.fromkeys([*lines.tips(), *np.flatnonzero(np.pad(centre, 1)).tolist()])
    found = []
    seen: set[int] = set()
    for start in todo:
        if start not in seen:
            path = lines.follow(start, centre.size)[0]
            fresh = next((index for index, cell in enumerate(path) if cell in seen), len(path))
            seen.update(path[:fresh])
            if fresh >= SIZES[0] + 2 * _SIDE:
                found.append(smooth(lines.places(path[:fresh])))
    return found


def drill(lines: list[NDArray[np.float64]]) -> NDArray[np.int64]:
    """Count hits and misses ``(len(SIZES), BANDS, 2)`` in all holes along ``lines``, each ``(n, 2)`` of x and y."""
    counts = np.zeros((len(SIZES), BANDS, 2), np.int64)
    long_enough = [line for line in lines if len(line) >= SIZES[0] + 2 * _SIDE]
    if long_enough:
        lengths = [len(line) for line in long_enough]
        last = np.repeat(np.cumsum(lengths), lengths)
        places = np.concatenate([np.rint(_THIRD * (line - np.rint(line[0]))) for line in long_enough]).T.copy()
        moments = _moments(places)
        for index, size in enumerate(SIZES):
            starts = np.flatnonzero(np.arange(len(last)) + size + 2 * _SIDE <= last)
            counts[index] = _counted(places, moments, starts, size)
    return counts


def hits_share(counts: NDArray[np.int64], size: float, away: NDArray[np.float64]) -> NDArray[np.float64]:
    """Share of hits ``(n,)`` so far from the end of holes of ``size`` cells; 0.9 where nothing was tried."""
    nearest = int(np.argmin(np.abs(np.log(np.array(SIZES) / max(size, 1.0)))))
    right, wrong = counts[nearest, _band(np.maximum(away, 1.0))].T
    return np.asarray((right + 18.0) / (right + wrong + 20.0), np.float64)


def _moments(places: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the sums ``(2, n, 3)`` of coordinate times step to the power 0, 1, 2 over the cells from each place on."""
    count = places.shape[1] - _SIDE + 1
    steps = np.arange(_SIDE, dtype=np.float64)
    blocks = sliding_window_view(places, _SIDE, axis=1)[:, :count]
    return np.asarray(blocks @ np.stack([steps**0, steps, steps**2], axis=1), np.float64)


def _counted(
    places: NDArray[np.float64], moments: NDArray[np.float64], starts: NDArray[np.int64], size: int
) -> NDArray[np.int64]:
    """Hits and misses ``(BANDS, 2)`` by distance, of holes of a size that begin a side's length after ``starts``."""
    hits = np.zeros(size, np.int64)
    truth = sliding_window_view(places, size, axis=1)
    for first in range(0, len(starts), _AT_ONCE // size):
        at = starts[first : first + _AT_ONCE // size]
        off = np.concatenate([moments[:, at], moments[:, at + _SIDE + size]], axis=2) @ _from_moments(size)
        off -= truth[:, at + _SIDE]
        off *= off
        hits += np.count_nonzero(off[0] + off[1] <= (_THIRD * _HIT) ** 2, axis=0)
    band = _band(np.minimum(np.arange(size), np.arange(size)[::-1]) + 1.0)
    right = np.bincount(band, hits, BANDS).astype(np.int64)
    return np.stack([right, np.bincount(band, minlength=BANDS) * len(starts) - right], axis=1)


@cache
def _from_moments(size: int) -> NDArray[np.float64]:
    """Matrix ``(6, size)`` from the moments on both sides to the cells between, by least squares."""
    order = 1 if size <= _STRAIGHT_TO else 2
    width = size + 2 * _SIDE
    place = (np.arange(width) - (width - 1) / 2.0) / (width / 2.0)
    known = np.vander(np.concatenate([place[:_SIDE], place[-_SIDE:]]), order + 1, increasing=True)
    fit = np.vander(place[_SIDE:-_SIDE], order + 1, increasing=True) @ np.linalg.inv(known.T @ known)
    step = 2.0 / width
    parts = []
    for start in (place[0], place[-_SIDE]):  # powers of (start + step k) from powers of k
        powers = np.array([[1.0, 0.0, 0.0], [start, step, 0.0], [start**2, 2.0 * start * step, step**2]])
        parts.append((fit @ powers[: order + 1]).T)
    return np.asarray(np.rint(np.concatenate(parts) * _FINE) / _FINE, np.float64)


def _band(away: NDArray[np.float64]) -> NDArray[np.int64]:
    return np.minimum(np.ceil(np.log2(away)), BANDS - 1).astype(np.int64)
