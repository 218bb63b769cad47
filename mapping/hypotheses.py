"""Where does a piece lie in another?  All its scans asked together, for what one scan leaves open another settles.

A piece is rigid to itself, so one pose of one of its scans places them all, and their likelihoods multiply.  Scans of
one piece see many of the same walls and err alike, so that together they count for more than one, but for less than
their number.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mapping.chart import Charts, doubted
from mapping.graph import put_at, seen_from
from mapping.likelihood import SIGMA_M, Likelihood
from mapping.modes import local_moments, pose_of
from mapping.pieces import Pieces, sd_m
from mapping.prior import Prior
from mapping.search import search
from mapping.signs import MOST_BEHIND, behind, overlap
from mapping.values import Pose
from mapping.view import View

ASKED = 4
"""Scans of a piece that are asked where it lies, those nearest in time to the other piece."""
ACCEPT_MARGIN = 12.0
"""Log-posterior above the best pose elsewhere from which a piece is joined to another ..."""
ACCEPT_SD_M = 0.3
"""... if it is so sure in every direction ..."""
WITNESSES = 2
"""... and so many of its scans, each for itself, lie on known walls;"""
LONE_MARGIN = 18.0
"""where only one does, the margin must be as large as this.  Where none does, nine joins in twenty are wrong."""
ACCEPT_OVERLAP, ACCEPT_FIT = 0.35, 0.35

OVERLAP_POWER, FEW = 0.8, 0.1
"""How far a score is divided by the share of the scan that falls on what is known; where that is less, no farther."""

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Fit:
    """Where the leading scan of a piece lies in another piece: ``covariance`` ``(3, 3)`` over x_m, y_m, heading_rad.

    ``height`` is the log-posterior, ``margin`` the same above the best pose elsewhere; ``witnesses`` of its scans lie
    on known walls, and no scan has more than the share ``behind`` of its points on walls seen from their other side.
    """

    pose: Pose
    covariance: Floats
    height: float
    margin: float
    witnesses: int
    behind: float = 0.0

    @property
    def is_sure(self) -> bool:
        """Tell whether the pieces may be joined."""
        needed = ACCEPT_MARGIN if self.witnesses >= WITNESSES else LONE_MARGIN
        possible = self.witnesses > 0 and self.behind <= MOST_BEHIND
        return possible and self.margin >= needed and sd_m(self.covariance) <= ACCEPT_SD_M


@dataclass(frozen=True, slots=True)
class _Asked:
    """A scan of the piece: its pose as the leading one sees it, its view, what it is held against."""

    seen: Pose
    view: View
    reference: View
    like: Likelihood
    known: NDArray[np.float32]

    def told(self, poses: Floats, sigma_m: float) -> Floats:
        """Log-likelihood ``(n,)`` of poses ``(n, 3)`` as if nearly all of the scan fell on what is known.

        Several stations know much, and much that is known draws scans to where they find their like.
        """
        xy, c, s = self.view.points.xy_m[::2], np.cos(poses[:, 2]), np.sin(poses[:, 2])
        x = poses[:, :1] + np.outer(c, xy[:, 0]) + np.outer(s, xy[:, 1])
        y = poses[:, 1:2] - np.outer(s, xy[:, 0]) + np.outer(c, xy[:, 1])
        known = self.known.take(self.reference.field.cells(x, y)).mean(axis=1)
        share = ((known + FEW) / (1.0 + FEW)) ** OVERLAP_POWER
        return np.asarray(self.like.witnesses * self.like.score(poses, sigma_m) / share, dtype=np.float64)


class Together:
    """Log-posterior of poses of the leading scan, by all scans that are asked."""

    def __init__(self, asked: Sequence[_Asked], prior: Prior) -> None:
        self._asked, self._prior = asked, prior
        self._power = 1.0 / math.sqrt(len(asked))

    def log_posterior(self, poses: Floats, sigma_m: float = SIGMA_M) -> Floats:
        """Log-posterior ``(n,)`` of poses ``(n, 3)``, up to a constant."""
        told = [each.told(_carried(poses, each.seen), sigma_m) for each in self._asked]
        return np.asarray(self._power * np.sum(told, axis=0) + self._prior.log_density(poses), dtype=np.float64)


def lies(
    pieces: Pieces, charts: Charts, pair: tuple[int, int], prior: Prior, particles: int, rng: np.random.Generator
) -> Fit:
    """Find where the second scan's piece lies in the first's; ``prior`` is of the second scan."""
    base, lead = pair
    order = sorted(pieces.of(lead), key=lambda k: (abs(k - lead), k))[:ASKED]
    asked = [_ask(pieces, charts, base, lead, k, prior) for k in order]
    like = Together(asked, prior)
    best, height = search(like, prior, particles, rng, np.zeros((0, 3)))
    other, other_height = search(like, prior, particles, rng, best[None, :])
    if other_height > height:
        best, height, other_height = other, other_height, height
    mean, covariance = local_moments(like, best)
    witnesses, most_behind = sum(_is_witness(each, best) for each in asked), max(_behind(each, best) for each in asked)
    found = Fit(pose_of(mean), covariance, height, height - other_height, witnesses, most_behind)
    sight = pieces.sight(lead)
    alone = charts.alone(sight, base, prior)
    first, _ = search(alone, prior, particles, rng, np.zeros((0, 3)))
    return replace(found, margin=min(found.margin, doubted(found, first, like, alone)))


def _ask(pieces: Pieces, charts: Charts, base: int, lead: int, k: int, prior: Prior) -> _Asked:
    seen, sight = seen_from(pieces.pose(lead), pieces.pose(k)), pieces.sight(k)
    there = put_at(Pose(prior.x_m, prior.y_m, prior.heading_rad), seen)
    about = replace(prior, x_m=there.x_m, y_m=there.y_m)
    reference = charts.reference(charts.about(base, (there.x_m, there.y_m), sight), about, sight)
    return _Asked(
        seen, sight.view, reference, Likelihood(sight.view, reference, about), reference.field.known().ravel()
    )


def _is_witness(each: _Asked, pose: Floats) -> bool:
    carried = _carried(pose[None, :], each.seen)
    fits = float(each.like.score(carried)[0]) >= ACCEPT_FIT
    return fits and overlap(each.view, each.reference, carried[0]) >= ACCEPT_OVERLAP


def _behind(each: _Asked, pose: Floats) -> float:
    return behind(each.view, each.reference, _carried(pose[None, :], each.seen)[0])


def _carried(poses: Floats, seen: Pose) -> Floats:
    """Poses ``(n, 3)`` of a scan that lies so to the leading one."""
    c, s = np.cos(poses[:, 2]), np.sin(poses[:, 2])
    x = poses[:, 0] + c * seen.x_m + s * seen.y_m
    y = poses[:, 1] - s * seen.x_m + c * seen.y_m
    return np.column_stack([x, y, poses[:, 2] + seen.heading_rad])
