"""How well a pose of a scan fits a reference: walls on walls, open water on open water, both ways round.

Each side's wall points are looked up in what the other side saw.  A point on a wall speaks for the pose, one in open
water against it, and one where nothing is known says nothing.  How much a point says was learnt: poses of real scans
were told apart from the best wrong ones by a conditional logit.  What is rare tells most: where a corner or clutter
meets its like, rather than where two long walls meet, which they do in many a wrong place.
"""

from __future__ import annotations

import math
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from mapping.field import KNOWN_M
from mapping.prior import Prior
from mapping.values import Pose
from mapping.view import LEVEL_M, LEVELS, View

SIGMA_M = 0.08
"""Width of a wall without annealing."""
ROUGH, PLAIN = 0, 1
ON_WALL = ((1.9, 2.0), (3.2, 0.6))
"""What a point says on a wall: a rough or a plain one, where the wall is rough or plain."""
BESIDE, BESIDE_M = (3.3, 0.3), 0.3
"""What a rough or a plain point says beside a wall, fading so far from it."""
IN_WATER, WATER_M = (-1.2, -4.5), 0.1
"""What it says in open water, from so far from walls ..."""
FAR_WATER, FAR_M = (-0.35, 1.16), 0.45
"""... and what farther out is added: it may be a ghost."""
WET_M = 0.25
"""From so far from walls, what is seen as open water is no wall's edge."""
FULL = 100.0
"""Points of a full scan; more of them err together and say no more."""
WIDE_M, FEWER = 0.15, 2
"""With walls as wide as this, points are neighbours: every second one says as much, in half the time."""
WITNESSES = 40.0
"""Independent points in a full scan: neighbouring returns share their errors, and walls repeat."""
POINTS_A_WITNESS = 2.5

Floats = NDArray[np.float64]
Singles = NDArray[np.float32]


class Posterior(Protocol):
    """Whatever tells the log-posterior ``(n,)`` of poses ``(n, 3)`` by walls of a given width."""

    def log_posterior(self, poses: Floats, sigma_m: float = ...) -> Floats:
        """Log-posterior, up to a constant."""


class Likelihood:
    """Log-posterior of poses of a scan in a reference, by walls of a given width.

    The reference may be told in the axes of a station ``at`` a pose of the map; poses and prior are of the map.
    """

    def __init__(self, scan: View, reference: View, prior: Prior, at: Pose | None = None) -> None:
        self._prior, self._at = prior, at
        points = max(FULL, float(scan.points.trust.sum()))
        self._forth = _Side(scan, reference, 0.5 / points)
        self._back = _Side(reference, scan, 0.5 / points)
        self.witnesses = WITNESSES

    def log_posterior(self, poses: Floats, sigma_m: float = SIGMA_M) -> Floats:
        """Log-posterior ``(n,)`` of poses ``(n, 3)``, up to a constant."""
        return self.witnesses * self.score(poses, sigma_m) + self._prior.log_density(poses)

    def score(self, poses: Floats, sigma_m: float = SIGMA_M) -> Floats:
        """Log-likelihood a witness ``(n,)`` of poses ``(n, 3)``, against having seen nothing in common."""
        seen = poses if self._at is None else _seen_from(self._at, poses)
        told = self._forth.sums(*_outward(seen), sigma_m) + self._back.sums(*_inward(seen), sigma_m)
        return told.astype(np.float64)

    def signs(self, poses: Floats) -> tuple[Floats, Floats, Floats]:
        """Tell of poses ``(n, 3)`` what the score is made of.

        The first ``(n, 10)`` are what lies on rough walls and on plain ones, beside walls, in open water and far out in
        it, of rough points and then of plain ones; the second ``(n, 6)`` the shares of the scan's points, and of the
        reference's, that lie where anything is known, on walls, and in open water; the third ``(n, 2)`` the scores of
        the scan's points and of the reference's.
        """
        seen = poses if self._at is None else _seen_from(self._at, poses)
        forth, back = self._forth.signs(*_outward(seen)), self._back.signs(*_inward(seen))
        ways = np.stack([self._forth.sums(*_outward(seen), SIGMA_M), self._back.sums(*_inward(seen), SIGMA_M)], axis=1)
        shares = np.concatenate([forth[1], back[1]], axis=1)
        return self.witnesses * (forth[0] + back[0]), shares, self.witnesses * ways.astype(np.float64)


class _Side:
    """One side's points, rough ones first, looked up in what the other side saw."""

    def __init__(self, points_of: View, seen_by: View, share: float) -> None:
        field = seen_by.field
        self._points, self._share = points_of.points, share
        self._codes, self._shape, self._cell_m = seen_by.codes, field.free.shape, field.cell_m
        self._corner = (field.x0_m, field.y0_m)
        self._spread = {1: self._every(1)}
        self._tables: dict[float, tuple[Singles, Singles]] = {}

    def sums(self, to_x: Floats, to_y: Floats, sigma_m: float) -> Singles:
        """Sum what the points say ``(n,)``, where affine rows ``(n, 3)`` bring them into the field's axes."""
        if sigma_m not in self._tables:
            rough, plain = (said(kind, sigma_m).take(self._codes) for kind in (ROUGH, PLAIN))
            self._tables[sigma_m] = (rough, plain)
        rough, plain = self._tables[sigma_m]
        step = FEWER if sigma_m >= WIDE_M else 1
        if step not in self._spread:
            self._spread[step] = self._every(step)
        xy1, weight, n = self._spread[step]
        cell = self._cells(to_x, to_y, xy1)
        with np.errstate(invalid="ignore"):  # some builds of BLAS raise the flag for what lies behind an array's end
            told = rough.take(cell[:, :n]) @ weight[:n] + plain.take(cell[:, n:]) @ weight[n:]
        return np.asarray(told, dtype=np.float32)

    def signs(self, to_x: Floats, to_y: Floats) -> tuple[Floats, Floats]:
        """Tell what the sums are made of, ``(n, 10)``, and the shares of points ``(n, 3)``; see the posterior's."""
        xy1, weight, n = self._spread[1]
        codes = self._codes.take(self._cells(to_x, to_y, xy1))
        rough, plain = (
            SIGNS.take(part, axis=1) @ told for part, told in ((codes[:, :n], weight[:n]), (codes[:, n:], weight[n:]))
        )
        known = (KNOWN.take(codes, axis=1) @ weight) / max(float(weight.sum()), 1e-9)
        return np.concatenate([rough, plain]).T.astype(np.float64), known.T.astype(np.float64)

    def _cells(self, to_x: Floats, to_y: Floats, xy1: Singles) -> NDArray[np.int32]:
        """Give the cells of the points, ``(n, points)``."""
        rows, cols = self._shape
        x, y = (self._in_cells(to, axis) @ xy1 for axis, to in enumerate((to_x, to_y)))
        cell = np.clip(y, 0, rows - 1, out=y).astype(np.int32)
        cell *= np.int32(cols)
        cell += np.clip(x, 0, cols - 1, out=x).astype(np.int32)
        return cell

    def _every(self, step: int) -> tuple[Singles, Singles, int]:
        """Take every so many of the points, each then speaking for as many: places, weights, how many are rough."""
        plain = np.isfinite(self._points.normal_rad)
        kinds = [np.flatnonzero(kind)[::step] for kind in (~plain, plain)]
        order = np.concatenate(kinds)
        xy1 = np.concatenate([self._points.xy_m[order].T, np.ones((1, len(order)))]).astype(np.float32)
        return xy1, (step * self._share * self._points.trust[order]).astype(np.float32), len(kinds[0])

    def _in_cells(self, rows: Floats, axis: int) -> Singles:
        rows[:, 2] -= self._corner[axis]
        return (rows / self._cell_m).astype(np.float32)


def said(kind: int, sigma_m: float) -> Singles:
    """Tell what a rough or plain point says at each code of ``mapping.view.codes_of``, by walls of a given width."""
    distance_m = np.arange(LEVELS) * LEVEL_M
    widths_m = (sigma_m, max(BESIDE_M, 1.5 * sigma_m), max(WATER_M, sigma_m))
    on, beside, dry = (np.exp(-0.5 * (distance_m / width_m) ** 2) for width_m in widths_m)
    far = distance_m > FAR_M * min(sigma_m / SIGMA_M, 2.0)
    table = np.zeros(256, dtype=np.float32)
    for rough in (0, 1):
        for free in (0, 1):
            water = free * (IN_WATER[kind] * (1.0 - dry) + FAR_WATER[kind] * far)
            at = (2 * rough + free) * LEVELS
            table[at : at + LEVELS] = ON_WALL[kind][1 - rough] * on + BESIDE[kind] * beside + water
    return table


def _tables() -> tuple[Singles, Singles]:
    """Make what codes mean: ``(5, 256)`` for what a score is made of, and ``(3, 256)`` for shares."""
    code = np.arange(256)
    distance_m, free, rough = code % LEVELS * LEVEL_M, code // LEVELS % 2 == 1, code // LEVELS >= 2
    on, beside, dry = (np.exp(-0.5 * (distance_m / width_m) ** 2) for width_m in (SIGMA_M, BESIDE_M, WATER_M))
    made_of = np.stack([on * rough, on * ~rough, beside, free * (1.0 - dry), free & (distance_m > FAR_M)])
    shares = np.stack([free | (distance_m < KNOWN_M), distance_m < 2.0 * SIGMA_M, free & (distance_m > WET_M)])
    return made_of.astype(np.float32), shares.astype(np.float32)


SIGNS, KNOWN = _tables()


def _seen_from(at: Pose, poses: Floats) -> Floats:
    """Tell poses ``(n, 3)`` of the map in the axes of one of them."""
    c, s = math.cos(at.heading_rad), math.sin(at.heading_rad)
    dx, dy = poses[:, 0] - at.x_m, poses[:, 1] - at.y_m
    return np.stack([c * dx - s * dy, s * dx + c * dy, poses[:, 2] - at.heading_rad], axis=1)


def _outward(poses: Floats) -> tuple[Floats, Floats]:
    """Rows ``(n, 3)`` that bring the scan's points into the reference's axes."""
    c, s = np.cos(poses[:, 2]), np.sin(poses[:, 2])
    return np.stack([c, s, poses[:, 0]], axis=1), np.stack([-s, c, poses[:, 1]], axis=1)


def _inward(poses: Floats) -> tuple[Floats, Floats]:
    """Rows ``(n, 3)`` that bring the reference's points into the scan's axes."""
    c, s = np.cos(poses[:, 2]), np.sin(poses[:, 2])
    x = np.stack([c, -s, s * poses[:, 1] - c * poses[:, 0]], axis=1)
    return x, np.stack([s, c, -s * poses[:, 0] - c * poses[:, 1]], axis=1)
