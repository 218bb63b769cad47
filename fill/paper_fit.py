"""The paper's curve: y = f(x), a polynomial of order 1 to 3 (Forrester et al. 2013, section 3.1.1).

As printed, y is a function of x whatever way the wall runs, the hole is cut out of the curve by x alone (equation 2),
and the order is that of the least mean distance of the sample points (equation 5).  A wall along y therefore is fitted
badly or not at all.  Where the text leaves a choice: the fit is least squares in centred x, which is what Gauss-Jordan
elimination gives where the normal equations can be solved, and of least norm where they cannot; the curve is sampled
every quarter cell of arc, and the cells that hold a sample are those it crosses (equation 1).

Coordinates are cells: x is the column, y the row.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

ORDERS: Final = (1, 2, 3)
_STEP: Final = 0.25
_FINE: Final = 0.05  # cells of x between the points that the arc is measured with


@dataclass(frozen=True, slots=True)
class Fit:
    """F through the sample points: ``points`` ``(n, 2)`` of x and y a quarter cell of arc apart; ``error``: Min_Err."""

    order: int
    points: NDArray[np.float64]
    error: float


@dataclass(frozen=True, slots=True)
class Crossed:
    """Cells of S_H: ``cells`` ``(n, 2)`` int64 of row and column, ``away`` ``(n,)`` d_e, arc to the nearer endpoint."""

    cells: NDArray[np.int64]
    away: NDArray[np.float64]


def best_fit(samples: NDArray[np.int64], rows: int) -> Fit:
    """Fit every order to sample cells ``(n, 2)`` of row and column, and take that of the least error."""
    return min((fit(samples, order, rows) for order in ORDERS), key=lambda each: each.error)


def fit(samples: NDArray[np.int64], order: int, rows: int) -> Fit:
    """Fit one order; the curve spans the samples in x, and is cut off beyond a grid of ``rows``."""
    y, x = samples.T.astype(np.float64)
    middle, scale = float(x.mean()), max(float(np.ptp(x)) / 2.0, 0.5)
    basis = np.vander((x - middle) / scale, order + 1, increasing=True)
    weights = np.linalg.lstsq(basis, y, rcond=None)[0]
    along = np.linspace(x.min() - 0.5, x.max() + 0.5, max(2, round((float(np.ptp(x)) + 1.0) / _FINE)))
    height = np.polynomial.polynomial.polyval((along - middle) / scale, weights)
    points = _sampled(np.stack([along, np.clip(height, -1.0, float(rows))], axis=1))
    error = float(np.mean(cKDTree(points).query(np.stack([x, y], axis=1))[0]))
    return Fit(order, points, error)


def crossed(curve: Fit, first: NDArray[np.int64], last: NDArray[np.int64], wall: NDArray[np.bool_]) -> Crossed:
    """Cells that are not wall, on the curve, between two endpoints (row, column) by their columns alone."""
    place = np.rint(curve.points).astype(np.int64)
    low, high = sorted((int(first[1]), int(last[1])))
    rows, cols = wall.shape
    kept = (place[:, 0] >= low) & (place[:, 0] <= high) & (place[:, 1] >= 0) & (place[:, 1] < rows)
    sample = np.flatnonzero(kept & (place[:, 0] >= 0) & (place[:, 0] < cols))
    flat = place[sample, 1] * cols + place[sample, 0]
    flat, inverse, count = np.unique(flat, return_inverse=True, return_counts=True)
    arc = np.bincount(inverse, sample, len(flat)) / np.maximum(count, 1) * _STEP
    ends = np.stack([first, last])[:, ::-1]
    starts = np.asarray(cKDTree(curve.points).query(ends)[1], np.float64) * _STEP
    away = np.abs(arc[:, None] - starts).min(axis=1)
    empty = ~wall.ravel()[flat]
    return Crossed(np.stack(np.divmod(flat[empty], cols), axis=1), away[empty])


def _sampled(points: NDArray[np.float64]) -> NDArray[np.float64]:
    length = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])
    at = np.arange(0.0, length[-1] + _STEP, _STEP)
    return np.stack([np.interp(at, length, points[:, axis]) for axis in (0, 1)], axis=1)
