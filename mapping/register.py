"""Where was this scan made?  An annealed particle filter without odometry, and how far its answer can be trusted.

After the published abstract of McVicker et al. 2012: relative poses of stationary scans by a particle filter, with no
motion model.  What the filter converged to says nothing about what it knows: the covariance is taken from the
likelihood without annealing, and the same filter is run again with the neighbourhood of its answer barred, to see how
well the best pose elsewhere does.  Where that pose lies along the same ridge (a tunnel holds a scan across, not along),
the ridge is told as one long mode, and the filter is run once more with all of it barred.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mapping.likelihood import SIGMA_M, Likelihood, Posterior
from mapping.modes import ELSEWHERE_M, ELSEWHERE_RAD, local_moments, pose_of, ridge_of
from mapping.prior import Prior
from mapping.values import Pose
from mapping.view import View, to_map


@dataclass(frozen=True, slots=True)
class Level:
    """A step of the filter: width of the walls, power of the likelihood, and particles as shares of their number.

    ``fresh`` ones are drawn from the prior once more: wide walls may lead to where little is known.
    """

    sigma_m: float
    power: float
    kept: float
    fresh: float = 0.0


LEVELS = (
    Level(0.4, 0.12, 1.0),
    Level(0.3, 0.2, 1.0, fresh=0.5),
    Level(0.2, 0.25, 1.0, fresh=0.5),
    Level(0.15, 0.3, 0.7),
    Level(0.1, 0.4, 0.5),
    Level(0.08, 0.5, 0.5),
)
"""From wide walls to narrow ones; a power that is high too early loses a place that shows its worth only late."""
JITTER_M = 0.5
"""Spread of resampled particles, as a share of the step's wall width; their headings likewise, per metre of lever."""
LEVER_M = 4.0
FACE_M = 0.25
"""Water is looked for so far from a wall, on its either side."""
RIDGE_MARGIN = 4.0
"""A pose elsewhere within this of the best one may lie on the same ridge; of a ridge, the best pose tells little."""

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Match:
    """Where a scan fits: ``covariance`` ``(3, 3)`` over x_m, y_m, heading_rad; ``margin`` in log-posterior.

    ``overlap`` is the share of the scan's weight that lies on known walls; ``weak_rad`` the direction (clockwise from
    north, in [0, pi)) in which the walls hold it least, and ``hold`` the information there, 0 to 0.5 of the whole.
    ``astray`` tells how many standard deviations the pose is from the prior's cloud, 0 without one.
    ``height`` is the log-posterior, ``fit`` the same per independent point, ``other`` the best pose elsewhere;
    ``alone`` is the fit to what one station of the reference saw, by itself, and ``behind`` the share of the scan's
    points that lie on walls which the reference saw from their other side.

    ``ridge`` tells that the posterior is one long mode: the pose is its mean, the covariance covers its length, and
    ``margin`` and ``other`` are of poses off the ridge.
    """

    pose: Pose
    covariance: Floats
    margin: float
    overlap: float
    weak_rad: float
    hold: float
    height: float
    fit: float
    alone: float
    behind: float
    other: Pose
    astray: float
    ridge: bool


def register(scan: View, reference: View, prior: Prior, particles: int, rng: np.random.Generator) -> Match:
    """Find the pose of a scan in a reference, its covariance and its margin to the best pose elsewhere."""
    like = Likelihood(scan, reference, prior)
    best, height = search(like, prior, particles, rng, np.zeros((0, 3)))
    other, other_height = search(like, prior, particles, rng, best[None, :])
    if other_height > height:
        best, height, other, other_height = other, other_height, best, height
    rival = height - other_height < RIDGE_MARGIN and math.hypot(*(best - other)[:2]) >= ELSEWHERE_M
    ridge = ridge_of(like, best, other) if rival else None
    if ridge is None:
        mean, covariance = local_moments(like, best)
    else:
        mean, covariance = ridge.mean, ridge.covariance
        other, other_height = search(like, prior, particles, rng, ridge.nodes)
    weak, hold = weakest_direction(scan, reference, best)
    on_walls = overlap(scan, reference, best)
    fit = float(like.score(best[None, :])[0])
    margin, astray = height - other_height, prior.astray(mean)
    return Match(
        pose_of(mean), covariance, margin, on_walls, weak, hold, height, fit, fit, behind(scan, reference, best),
        pose_of(other), astray, ridge is not None,
    )  # fmt: skip


def search(
    like: Posterior, prior: Prior, particles: int, rng: np.random.Generator, barred: Floats
) -> tuple[Floats, float]:
    """Anneal particles from the prior to the best pose ``(3,)``, not near barred ones, in place and in heading."""
    poses = prior.draw(particles, rng)
    for level in LEVELS:
        n = max(int(particles * level.kept), 1)
        poses = np.concatenate([poses, prior.draw(int(particles * level.fresh), rng)])
        log_p = level.power * _bar(like.log_posterior(poses, level.sigma_m), poses, barred)
        poses = poses[_resample(log_p, n, rng)]
        poses[:, :2] += rng.normal(0.0, JITTER_M * level.sigma_m, (n, 2))
        poses[:, 2] += rng.normal(0.0, JITTER_M * level.sigma_m / LEVER_M, n)
    for spread in (0.05, 0.025, 0.0125):
        log_p = _bar(like.log_posterior(poses), poses, barred)
        top = poses[int(np.argmax(log_p))]
        moves = rng.normal(0.0, 1.0, (particles // 4, 3)) * [spread, spread, 2.0 * spread / LEVER_M]
        poses = np.concatenate([top[None, :], top + moves])
    log_p = _bar(like.log_posterior(poses), poses, barred)
    return poses[int(np.argmax(log_p))], float(log_p.max())


def _bar(log_p: Floats, poses: Floats, barred: Floats) -> Floats:
    near = np.zeros(len(poses), dtype=bool)
    for x_m, y_m, heading_rad in barred:
        turned = np.abs((poses[:, 2] - heading_rad + math.pi) % (2.0 * math.pi) - math.pi)
        near |= (np.hypot(poses[:, 0] - x_m, poses[:, 1] - y_m) < ELSEWHERE_M) & (turned < ELSEWHERE_RAD)
    return np.where(near, -1e6, log_p)


def _resample(log_p: Floats, n: int, rng: np.random.Generator) -> NDArray[np.intp]:
    """Draw particles by weight, systematically: ``(n,)`` indices."""
    total = np.cumsum(np.exp(log_p - log_p.max()))
    drawn: NDArray[np.intp] = np.searchsorted(total, (np.arange(n) + rng.random()) / n * total[-1])
    return np.minimum(drawn, len(total) - 1)


def overlap(scan: View, reference: View, pose: Floats) -> float:
    """Share of the scan's points, by weight, within twice the walls' width of the reference's walls."""
    return float(_near(scan, reference, pose) @ scan.points.weight)


def _near(scan: View, reference: View, pose: Floats) -> Floats:
    xy = to_map(pose_of(pose), scan.points.xy_m)
    distance_m = reference.field.distance_m.ravel().take(reference.field.cells(xy[:, 0], xy[:, 1]))
    return np.asarray(distance_m < 2.0 * SIGMA_M, dtype=np.float64)


def behind(scan: View, reference: View, pose: Floats) -> float:
    """Share of a scan's points that lie on walls of the reference, but with the water on the wrong side of the wall."""
    plain = np.isfinite(scan.points.normal_rad)
    xy, normal = scan.points.xy_m[plain], scan.points.normal_rad[plain]
    ahead = np.stack([np.cos(normal), np.sin(normal)], axis=1)
    ahead *= np.where((xy * ahead).sum(axis=1) > 0.0, -FACE_M, FACE_M)[:, None]  # to where the scan was made
    at, field = pose_of(pose), reference.field
    on, before, after = (field.cells(*to_map(at, xy + off).T) for off in (np.zeros(2), ahead, -ahead))
    free = field.free.ravel()
    wrong = (field.distance_m.ravel().take(on) < 2.0 * SIGMA_M) & free.take(after) & ~free.take(before)
    return float(wrong.sum()) / max(len(plain), 1)


def weakest_direction(scan: View, reference: View, pose: Floats) -> tuple[float, float]:
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
