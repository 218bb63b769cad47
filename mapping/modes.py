"""Modes of a posterior over poses: where each lies, how wide it is, and whether two are one long ridge."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mapping.likelihood import Likelihood, Posterior
from mapping.values import Pose

ELSEWHERE_M = 0.6
ELSEWHERE_RAD = math.radians(25.0)
"""Poses nearer than this are the same answer."""
BENT_SD_M = 0.012
"""What scans are bent by, and walls do not tell: no pose is surer than this."""
RIDGE_STEP_M = 0.15
RIDGE_DIP = 4.0
"""Two modes are one ridge where the log-posterior between them falls no deeper than this below the lower one ..."""
RIDGE_FLOOR = 8.0
"""... and the ridge goes on, beyond them, down to this below the best."""
RIDGE_FAR_M = 3.0
"""A ridge is followed so far beyond the two."""
RIDGE_TEMPER = 0.2
"""Power of the likelihood along a ridge: small differences between repeated walls tell little."""

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Ridge:
    """A straight line of poses ``(n, 3)`` along which the posterior is high, with its moments."""

    nodes: Floats
    mean: Floats
    covariance: Floats


@dataclass(frozen=True, slots=True)
class Mode:
    """A place where a posterior is high: its best ``pose`` ``(3,)``, log-posterior, mean and covariance."""

    pose: Floats
    height: float
    mean: Floats
    covariance: Floats

    @property
    def sd_m(self) -> float:
        """Largest standard deviation of the place in any direction."""
        return math.sqrt(float(np.linalg.eigvalsh(self.covariance[:2, :2])[-1]))


def mode_at(like: Posterior, pose: Floats) -> Mode:
    """Tell of a mode whose best pose is known."""
    mean, covariance = local_moments(like, pose)
    return Mode(pose, float(like.log_posterior(pose[None, :])[0]), mean, covariance)


def is_elsewhere(one: Floats, other: Floats) -> bool:
    """Tell whether two poses ``(3,)`` are two answers."""
    turned = (float(one[2] - other[2]) + math.pi) % (2.0 * math.pi) - math.pi
    return math.hypot(*(one - other)[:2]) >= ELSEWHERE_M or abs(turned) >= ELSEWHERE_RAD


def pose_of(state: Floats) -> Pose:
    """Make a pose of x_m, y_m, heading_rad ``(3,)``."""
    return Pose(float(state[0]), float(state[1]), float(state[2]) % (2.0 * math.pi))


def local_moments(like: Posterior, best: Floats) -> tuple[Floats, Floats]:
    """Mean ``(3,)`` and covariance ``(3, 3)`` of the un-annealed posterior about a pose, on a lattice.

    The lattice widens where the posterior reaches its edge: a tunnel holds a scan across, not along.
    """
    mean, covariance = best, np.eye(3)
    turns = np.radians(np.arange(-5.0, 5.1, 1.0))
    for half, step in ((0.2, 0.04), (0.6, 0.12), (1.8, 0.3)):
        offsets = np.arange(-half, half + 1e-9, step)
        dx, dy, dh = np.meshgrid(offsets, offsets, turns, indexing="ij")
        poses = best + np.stack([dx.ravel(), dy.ravel(), dh.ravel()], axis=1)
        mean, covariance = _moments(poses, like.log_posterior(poses))
        covariance += np.diag([step**2, step**2, math.radians(1.0) ** 2]) / 12.0
        covariance[:2, :2] += BENT_SD_M**2 * np.eye(2)
        if np.linalg.eigvalsh(covariance[:2, :2])[-1] < (half / 3.0) ** 2:
            break
    return mean, covariance


def _moments(poses: Floats, log_p: Floats) -> tuple[Floats, Floats]:
    weight = np.exp(log_p - log_p.max())
    weight /= weight.sum()
    mean = weight @ poses
    off = poses - mean
    return mean, (weight[:, None] * off).T @ off


def ridge_of(like: Likelihood, best: Floats, other: Floats) -> Ridge | None:
    """Join two poses into one ridge, where the posterior does not fall off between them; None where it does."""
    length = float(np.hypot(*(other - best)[:2]))
    along = (other - best) / length
    places = np.arange(-RIDGE_FAR_M, length + RIDGE_FAR_M + 1e-9, RIDGE_STEP_M)
    across = np.array([-along[1], along[0]])
    aside, turned = np.arange(-0.25, 0.26, 0.05), np.radians(np.arange(-4.5, 4.6, 1.5))
    u, v, h = np.meshgrid(places, aside, turned, indexing="ij")
    xy = best[:2] + u.reshape(-1, 1) * along[:2] + v.reshape(-1, 1) * across
    poses = np.column_stack([xy, best[2] + np.clip(u.ravel(), 0.0, length) * along[2] + h.ravel()])
    log_p = like.log_posterior(poses).reshape(len(places), -1)
    heights = log_p.max(axis=1)
    between = (places >= 0.0) & (places <= length)
    ends = [float(heights[np.argmin(np.abs(places - end))]) for end in (0.0, length)]
    if heights[between].min() < min(ends) - RIDGE_DIP:
        return None
    first, last = _extent(heights >= heights[between].max() - RIDGE_FLOOR, between)
    rows = slice(first, last + 1)
    kept = poses.reshape(len(places), -1, 3)[rows]
    mean, _ = _moments(kept.reshape(-1, 3), log_p[rows].ravel())
    # Along the ridge the power is low; across it, as it is.
    flat = log_p[rows] - (1.0 - RIDGE_TEMPER) * heights[rows, None]
    middle, covariance = _moments(kept.reshape(-1, 3), flat.ravel())
    covariance += np.outer(middle - mean, middle - mean)
    steps = along[:2] * RIDGE_STEP_M
    covariance[:2, :2] += (np.outer(steps, steps) + 0.05**2 * np.eye(2)) / 12.0 + BENT_SD_M**2 * np.eye(2)
    nodes = kept[np.arange(len(kept)), log_p[rows].argmax(axis=1)]
    return Ridge(nodes, mean, covariance)


def _extent(high: NDArray[np.bool_], between: NDArray[np.bool_]) -> tuple[int, int]:
    """First and last row of the run of high rows about those between."""
    joined = high | between
    first, last = int(np.argmax(between)), len(between) - 1 - int(np.argmax(between[::-1]))
    while first > 0 and joined[first - 1]:
        first -= 1
    while last < len(joined) - 1 and joined[last + 1]:
        last += 1
    return first, last
