"""An annealed particle filter without odometry: where a posterior is highest.

After the published abstract of McVicker et al. 2012: relative poses of stationary scans by a particle filter, with no
motion model.  What the filter converged to says nothing about what it knows: that is taken from the posterior itself.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mapping.likelihood import Posterior
from mapping.modes import ELSEWHERE_M, ELSEWHERE_RAD
from mapping.prior import Prior


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
NOWHERE = -1e6
"""Log-posterior of what is barred."""

Floats = NDArray[np.float64]


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
    return np.where(near, NOWHERE, log_p)


def _resample(log_p: Floats, n: int, rng: np.random.Generator) -> NDArray[np.intp]:
    """Draw particles by weight, systematically: ``(n,)`` indices."""
    total = np.cumsum(np.exp(log_p - log_p.max()))
    drawn: NDArray[np.intp] = np.searchsorted(total, (np.arange(n) + rng.random()) / n * total[-1])
    return np.minimum(drawn, len(total) - 1)
