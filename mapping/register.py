"""Where was this scan made?  An annealed particle filter without odometry, and how far its answer can be trusted.

After the published abstract of McVicker et al. 2012: relative poses of stationary scans by a particle filter, with no
motion model.  The likelihood is scored both ways round, each side's wall points in what the other side saw, in three
states.  What the filter converged to says nothing about what it knows: the covariance is taken from the likelihood
without annealing, and the same filter is run again with the neighbourhood of its answer barred, to see how well the
best pose elsewhere does.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mapping.prior import Prior
from mapping.values import Pose
from mapping.view import View, to_map

SIGMAS_M = (0.5, 0.4, 0.3, 0.24, 0.19, 0.15, 0.12, 0.1)
"""Widths of a wall, from the first step of the filter to the last."""
SIGMA_M = 0.1
"""Width of a wall without annealing."""
SECOND_LOOK_M = 0.24
"""At this width the prior is asked once more: wide walls may lead to where little is known."""
TEMPER = 0.5
"""Power of the likelihood in resampling."""
JITTER_M = 0.5
"""Spread of resampled particles, as a share of the step's wall width; their headings likewise, per metre of lever."""
LEVER_M = 4.0
WITNESSES = 40.0
"""Independent points in a full scan: neighbouring returns share their errors, and walls repeat."""
POINTS_A_WITNESS = 2.5
OVERLAP_POWER = 0.5
FEW = 0.1
"""Share of known points below which dividing by it stops."""
ELSEWHERE_M = 0.6
"""Poses nearer than this are the same answer."""


@dataclass(frozen=True, slots=True)
class Match:
    """Where a scan fits: ``covariance`` ``(3, 3)`` over x_m, y_m, heading_rad; ``margin`` in log-posterior.

    ``overlap`` is the share of the scan's weight that lies on known walls; ``weak_rad`` the direction (clockwise from
    north, in [0, pi)) in which the walls hold it least, and ``hold`` the information there, 0 to 0.5 of the whole.
    ``astray`` tells how many standard deviations the pose is from the prior's cloud, 0 without one.
    ``height`` is the log-posterior, ``fit`` the same per independent point, ``other`` the best pose elsewhere.
    """

    pose: Pose
    covariance: NDArray[np.float64]
    margin: float
    overlap: float
    weak_rad: float
    hold: float
    height: float
    fit: float
    other: Pose
    astray: float


class Likelihood:
    """Log-posterior of poses of a scan in a reference, by walls of a given width."""

    def __init__(self, scan: View, reference: View, prior: Prior) -> None:
        self._scan, self._reference, self._prior = scan, reference, prior
        self._tables: dict[float, tuple[NDArray[np.float32], NDArray[np.float32]]] = {}
        self._known = (reference.field.known(), scan.field.known())
        own, other = len(scan.points.xy_m), len(reference.points.xy_m)
        self.witnesses = min(WITNESSES, float(scan.points.trust.sum()) / POINTS_A_WITNESS)
        # A map has more walls than one scan can see; those it does not see are neutral and must not dilute the others.
        self._share = max(1.0, other / max(own, 1))

    def log_posterior(self, poses: NDArray[np.float64], sigma_m: float) -> NDArray[np.float64]:
        """Log-posterior ``(n,)`` of poses ``(n, 3)``, up to a constant."""
        return self.witnesses * self.score(poses, sigma_m) + self._prior.log_density(poses)

    def score(self, poses: NDArray[np.float64], sigma_m: float) -> NDArray[np.float64]:
        """Mean score of the points, both ways round, ``(n,)``.

        Points that fall where nothing is known score nothing, so the sum draws scans to where they overlap most:
        along a tunnel, to no motion at all.  Dividing by a power of the share that is known takes most of that away.
        """
        if sigma_m not in self._tables:
            self._tables[sigma_m] = (self._reference.field.scores(sigma_m), self._scan.field.scores(sigma_m))
        forth = self._cells(poses)
        back = self._cells_back(poses)
        own, other = self._scan.points.weight, self._share * self._reference.points.weight
        total, known = (
            0.5 * (outward.ravel().take(forth) @ own + inward.ravel().take(back) @ other)
            for outward, inward in (self._tables[sigma_m], self._known)
        )
        return np.asarray(total / ((known + FEW) / (1.0 + FEW)) ** OVERLAP_POWER, dtype=np.float64)

    def _cells(self, poses: NDArray[np.float64]) -> NDArray[np.int32]:
        """Cells of the reference's field in which the scan's points fall, ``(n, points)``."""
        c, s = np.cos(poses[:, 2])[:, None], np.sin(poses[:, 2])[:, None]
        x, y = self._scan.points.xy_m[:, 0], self._scan.points.xy_m[:, 1]
        return self._reference.field.cells(poses[:, :1] + c * x + s * y, poses[:, 1:2] - s * x + c * y)

    def _cells_back(self, poses: NDArray[np.float64]) -> NDArray[np.int32]:
        """Cells of the scan's field in which the reference's points fall, ``(n, points)``."""
        c, s = np.cos(poses[:, 2])[:, None], np.sin(poses[:, 2])[:, None]
        dx = self._reference.points.xy_m[:, 0] - poses[:, :1]
        dy = self._reference.points.xy_m[:, 1] - poses[:, 1:2]
        return self._scan.field.cells(c * dx - s * dy, s * dx + c * dy)


def register(scan: View, reference: View, prior: Prior, particles: int, rng: np.random.Generator) -> Match:
    """Find the pose of a scan in a reference, its covariance and its margin to the best pose elsewhere."""
    like = Likelihood(scan, reference, prior)
    best, height = search(like, prior, particles, rng, None)
    other, other_height = search(like, prior, particles, rng, best)
    if other_height > height:
        best, height, other, other_height = other, other_height, best, height
    mean, covariance = local_moments(like, best)
    weak, hold = weakest_direction(scan, reference, mean)
    on_walls = overlap(scan, reference, mean)
    fit = float(like.score(best[None, :], SIGMA_M)[0])
    margin, astray = height - other_height, prior.astray(mean)
    return Match(_pose(mean), covariance, margin, on_walls, weak, hold, height, fit, _pose(other), astray)


def _pose(state: NDArray[np.float64]) -> Pose:
    return Pose(float(state[0]), float(state[1]), float(state[2]) % (2.0 * math.pi))


def search(
    like: Likelihood, prior: Prior, particles: int, rng: np.random.Generator, barred: NDArray[np.float64] | None
) -> tuple[NDArray[np.float64], float]:
    """Anneal particles from the prior to the best pose ``(3,)``, not within ``ELSEWHERE_M`` of the barred one."""
    poses = prior.draw(particles, rng)
    for sigma in SIGMAS_M:
        if sigma == SECOND_LOOK_M:
            poses = np.concatenate([poses, prior.draw(particles, rng)])
        log_p = TEMPER * _bar(like.log_posterior(poses, sigma), poses, barred)
        poses = poses[_resample(log_p, particles, rng)]
        poses[:, :2] += rng.normal(0.0, JITTER_M * sigma, (particles, 2))
        poses[:, 2] += rng.normal(0.0, JITTER_M * sigma / LEVER_M, particles)
    for spread in (0.05, 0.025, 0.0125):
        log_p = _bar(like.log_posterior(poses, SIGMA_M), poses, barred)
        top = poses[int(np.argmax(log_p))]
        moves = rng.normal(0.0, 1.0, (particles // 4, 3)) * [spread, spread, 2.0 * spread / LEVER_M]
        poses = np.concatenate([top[None, :], top + moves])
    log_p = _bar(like.log_posterior(poses, SIGMA_M), poses, barred)
    return poses[int(np.argmax(log_p))], float(log_p.max())


def _bar(
    log_p: NDArray[np.float64], poses: NDArray[np.float64], barred: NDArray[np.float64] | None
) -> NDArray[np.float64]:
    if barred is None:
        return log_p
    near = np.hypot(poses[:, 0] - barred[0], poses[:, 1] - barred[1]) < ELSEWHERE_M
    return np.where(near, -1e6, log_p)


def _resample(log_p: NDArray[np.float64], n: int, rng: np.random.Generator) -> NDArray[np.intp]:
    """Draw particles by weight, systematically: ``(n,)`` indices."""
    total = np.cumsum(np.exp(log_p - log_p.max()))
    drawn: NDArray[np.intp] = np.searchsorted(total, (np.arange(n) + rng.random()) / n * total[-1])
    return np.minimum(drawn, len(total) - 1)


def local_moments(like: Likelihood, best: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Mean ``(3,)`` and covariance ``(3, 3)`` of the un-annealed posterior about a pose, on a lattice.

    The lattice widens where the posterior reaches its edge: a tunnel holds a scan across, not along.
    """
    mean, covariance = best, np.eye(3)
    for half, step in ((0.2, 0.04), (0.6, 0.12), (1.8, 0.3)):
        offsets = np.arange(-half, half + 1e-9, step)
        turns = np.radians(np.arange(-5.0, 5.1, 1.0))
        dx, dy, dh = np.meshgrid(offsets, offsets, turns, indexing="ij")
        poses = best + np.stack([dx.ravel(), dy.ravel(), dh.ravel()], axis=1)
        log_p = like.log_posterior(poses, SIGMA_M)
        weight = np.exp(log_p - log_p.max())
        weight /= weight.sum()
        mean = weight @ poses
        off = poses - mean
        covariance = (weight[:, None] * off).T @ off + np.diag([step**2, step**2, math.radians(1.0) ** 2]) / 12.0
        if np.linalg.eigvalsh(covariance[:2, :2])[-1] < (half / 3.0) ** 2:
            break
    return mean, covariance


def overlap(scan: View, reference: View, pose: NDArray[np.float64]) -> float:
    """Share of the scan's points, by weight, within twice the walls' width of the reference's walls."""
    return float(_near(scan, reference, pose) @ scan.points.weight)


def _near(scan: View, reference: View, pose: NDArray[np.float64]) -> NDArray[np.float64]:
    xy = to_map(_pose(pose), scan.points.xy_m)
    distance_m = reference.field.distance_m.ravel().take(reference.field.cells(xy[:, 0], xy[:, 1]))
    return np.asarray(distance_m < 2.0 * SIGMA_M, dtype=np.float64)


def weakest_direction(scan: View, reference: View, pose: NDArray[np.float64]) -> tuple[float, float]:
    """Direction in which the matched walls hold the scan least, and their information there (0 to 0.5)."""
    known = np.isfinite(scan.points.normal_rad)
    weight = np.where(known, _near(scan, reference, pose), 0.0)
    if weight.sum() <= 0.0:
        return 0.0, 0.0
    angle = np.where(known, scan.points.normal_rad, 0.0) - pose[2]  # of axes that turn counter-clockwise
    n = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    information = (n * (weight / weight.sum())[:, None]).T @ n
    value, vector = np.linalg.eigh(information)
    return float(math.atan2(vector[0, 0], vector[1, 0]) % math.pi), float(value[0])
