"""How well a pose of a scan fits a reference: walls on walls, open water on open water, both ways round.

Each side's wall points are scored in what the other side saw, in three states.  The scores of all points are averaged,
and the mean counts as much as the points that err independently of each other.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from mapping.prior import Prior
from mapping.view import Field, Points, View

SIGMA_M = 0.1
"""Width of a wall without annealing."""
WITNESSES = 40.0
"""Independent points in a full scan: neighbouring returns share their errors, and walls repeat."""
POINTS_A_WITNESS = 2.5
OVERLAP_POWER = 0.5
FEW = 0.1
"""Share of known points below which dividing by it stops."""

Floats = NDArray[np.float64]
Singles = NDArray[np.float32]


class Posterior(Protocol):
    """Whatever tells the log-posterior ``(n,)`` of poses ``(n, 3)`` by walls of a given width."""

    def log_posterior(self, poses: Floats, sigma_m: float = ...) -> Floats:
        """Log-posterior, up to a constant."""


class Likelihood:
    """Log-posterior of poses of a scan in a reference, by walls of a given width."""

    def __init__(self, scan: View, reference: View, prior: Prior) -> None:
        self._prior = prior
        own, other = len(scan.points.xy_m), len(reference.points.xy_m)
        # A map has more walls than one scan can see; those it does not see are neutral and must not dilute the others.
        share = max(1.0, other / max(own, 1))
        self._forth = _Side(scan.points, reference.field, 0.5)
        self._back = _Side(reference.points, scan.field, 0.5 * share)
        self.witnesses = min(WITNESSES, float(scan.points.trust.sum()) / POINTS_A_WITNESS)

    def log_posterior(self, poses: Floats, sigma_m: float = SIGMA_M) -> Floats:
        """Log-posterior ``(n,)`` of poses ``(n, 3)``, up to a constant."""
        return self.witnesses * self.score(poses, sigma_m) + self._prior.log_density(poses)

    def score(self, poses: Floats, sigma_m: float = SIGMA_M) -> Floats:
        """Mean score of the points, both ways round, ``(n,)``.

        Points that fall where nothing is known score nothing, so the sum draws scans to where they overlap most:
        along a tunnel, to no motion at all.  Dividing by a power of the share that is known takes most of that away.
        """
        told = self._forth.sums(_outward(poses), sigma_m) + self._back.sums(_inward(poses), sigma_m)
        total, known = told.real.astype(np.float64), told.imag.astype(np.float64)
        return np.asarray(total / ((known + FEW) / (1.0 + FEW)) ** OVERLAP_POWER, dtype=np.float64)


class _Side:
    """One side's points, looked up in what the other side saw: score and known share in one look, as real and imag."""

    def __init__(self, points: Points, field: Field, share: float) -> None:
        self._field = field
        self._xy1 = np.concatenate([points.xy_m.T, np.ones((1, len(points.xy_m)))]).astype(np.float32)
        self._weight = (share * points.weight).astype(np.complex64)
        self._tables: dict[float, NDArray[np.complex64]] = {}

    def sums(self, rows: tuple[Singles, Singles], sigma_m: float) -> NDArray[np.complex64]:
        """Sum of weighted scores and of weights where something is known, ``(n,)``, of affine ``rows`` of poses."""
        if sigma_m not in self._tables:
            scores = self._field.scores(sigma_m).ravel()
            self._tables[sigma_m] = (scores + 1j * self._field.known().ravel()).astype(np.complex64)
        x, y = (row @ self._xy1 for row in rows)
        return np.asarray(self._tables[sigma_m].take(self._field.cells(x, y)) @ self._weight, dtype=np.complex64)


def _outward(poses: Floats) -> tuple[Singles, Singles]:
    """Rows ``(n, 3)`` that bring the scan's points into the reference's axes."""
    c, s = np.cos(poses[:, 2]), np.sin(poses[:, 2])
    x, y = np.stack([c, s, poses[:, 0]], axis=1), np.stack([-s, c, poses[:, 1]], axis=1)
    return x.astype(np.float32), y.astype(np.float32)


def _inward(poses: Floats) -> tuple[Singles, Singles]:
    """Rows ``(n, 3)`` that bring the reference's points into the scan's axes."""
    c, s = np.cos(poses[:, 2]), np.sin(poses[:, 2])
    x = np.stack([c, -s, s * poses[:, 1] - c * poses[:, 0]], axis=1)
    y = np.stack([s, c, -s * poses[:, 0] - c * poses[:, 1]], axis=1)
    return x.astype(np.float32), y.astype(np.float32)
