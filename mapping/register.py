"""Where was this scan made?  Where its posterior is highest, what else it may be, and how sure that is.

The filter is run again with the neighbourhoods of its answers barred, which gives several modes; which is right is
judged from what speaks for each and against it (``signs.py``), by trees that were grown on real scans.
Where a wrong place is higher than the right one, its height is all that it has.  Where the best pose elsewhere lies
along the same ridge (a tunnel holds a scan across, not along), the ridge is told as one long mode.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mapping.likelihood import Likelihood
from mapping.modes import ELSEWHERE_M, Mode, Ridge, is_elsewhere, mode_at, pose_of, ridge_of
from mapping.prior import Prior
from mapping.search import NOWHERE, search
from mapping.signs import behind, odds_of, overlap, signs_of, weakest_direction
from mapping.values import Pose
from mapping.view import View

MODES, FEWER = 5, 3
"""So many modes are looked for, those after the first with a third of the particles."""
RIDGE_MARGIN = 4.0
"""A pose elsewhere within this of the best one may lie on the same ridge; of a ridge, the best pose tells little ..."""
UNSURE = 1.0
"""... where no mode has at least these log-odds of being right."""
CHALLENGED = 0.25
"""Log-odds that a match loses with each unit of its margin that another prior takes away ..."""
MOST_MARGIN = 30.0
"""... from this on."""

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Match:
    """Where a scan fits: ``covariance`` ``(3, 3)`` over x_m, y_m, heading_rad; ``margin`` in log-posterior.

    ``odds`` are the log-odds that it is right.  ``overlap`` is the share of the scan's weight that lies on known walls;
    ``weak_rad`` the direction (clockwise from north, in [0, pi)) in which the walls hold it least, and ``hold`` the
    information there, 0 to 0.5 of the whole.  ``astray`` tells how many standard deviations the pose is from the
    prior's cloud, 0 without one.  ``height`` is the log-posterior, ``fit`` the same per independent point, ``behind``
    the share of the scan's points on walls that the reference saw from their other side, and ``other`` the best pose
    elsewhere, which may be higher: then the margin is negative.

    ``ridge`` tells that the posterior is one long mode: the pose is its mean, the covariance covers its length, and
    ``margin`` and ``other`` are of poses off the ridge.
    """

    pose: Pose
    covariance: Floats
    margin: float
    odds: float
    overlap: float
    weak_rad: float
    hold: float
    height: float
    fit: float
    behind: float
    other: Pose
    astray: float
    ridge: bool


def register(
    scan: View,
    reference: View,
    prior: Prior,
    particles: int,
    rng: np.random.Generator,
    alone: Likelihood | None = None,
) -> Match:
    """Find the pose of a scan in a reference, its covariance and how far other poses are behind.

    ``alone`` holds the scan against what one station of the reference saw, by itself, where there are several: where
    much is known a scan finds its like, and a place at the edge of what is known has less to show for itself.
    """
    like = Likelihood(scan, reference, prior)
    modes = modes_of(like, prior, particles, rng, alone)
    odds = odds_of(signs_of(scan, reference, like, prior, modes, alone))
    best = int(np.argmax(odds))
    ridge = _ridge(like, modes) if odds[best] < UNSURE else None
    if ridge is not None:
        best = 0
    return _told(scan, reference, like, prior, (modes, best, float(odds[best]), ridge))


def modes_of(
    like: Likelihood, prior: Prior, particles: int, rng: np.random.Generator, alone: Likelihood | None = None
) -> list[Mode]:
    """Find the highest modes of a posterior, and that of ``alone``, highest first."""
    found = np.zeros((0, 3))
    for k in range(MODES):
        pose, height = search(like, prior, particles if k == 0 else particles // FEWER, rng, found)
        if k and height <= NOWHERE:
            break
        found = np.concatenate([found, pose[None, :]])
    if alone is not None:
        pose, _ = search(alone, prior, particles // 2, rng, np.zeros((0, 3)))
        if all(is_elsewhere(pose, each) for each in found):
            found = np.concatenate([found, pose[None, :]])
    modes = [mode_at(like, pose) for pose in found]
    return sorted(modes, key=lambda mode: -mode.height)


def challenged(match: Match, rival: float) -> Match:
    """Take into account that under another prior a pose elsewhere is as high as ``rival``."""
    margin = min(match.margin, match.height - rival)
    lost = min(match.margin, MOST_MARGIN) - min(margin, MOST_MARGIN)
    return replace(match, margin=margin, odds=match.odds - CHALLENGED * lost)


def _told(
    scan: View, reference: View, like: Likelihood, prior: Prior, found: tuple[list[Mode], int, float, Ridge | None]
) -> Match:
    """Tell of one of several modes, by its number, all that a verdict needs."""
    modes, best, odds, ridge = found
    mode = modes[best]
    barred = [mode.pose] if ridge is None else [mode.pose, *ridge.nodes]
    others = (each for each in modes if all(is_elsewhere(each.pose, pose) for pose in barred))
    other = next(others, replace(mode, height=NOWHERE))
    mean, covariance = (mode.mean, mode.covariance) if ridge is None else (ridge.mean, ridge.covariance)
    weak, hold = weakest_direction(scan, reference, mode.pose)
    return Match(
        pose=pose_of(mean),
        covariance=covariance,
        margin=mode.height - other.height,
        odds=odds,
        overlap=overlap(scan, reference, mode.pose),
        weak_rad=weak,
        hold=hold,
        height=mode.height,
        fit=float(like.score(mode.pose[None, :])[0]),
        behind=behind(scan, reference, mode.pose),
        other=pose_of(other.pose),
        astray=prior.astray(mean),
        ridge=ridge is not None,
    )


def _ridge(like: Likelihood, modes: Sequence[Mode]) -> Ridge | None:
    """Join the highest mode with the best one elsewhere, where these are two places of one ridge."""
    first = modes[0]
    for other in [mode for mode in modes if is_elsewhere(mode.pose, first.pose)][:1]:
        near = first.height - other.height < RIDGE_MARGIN
        if near and float(np.hypot(*(first.pose - other.pose)[:2])) >= ELSEWHERE_M:
            return ridge_of(like, first.pose, other.pose)
    return None
