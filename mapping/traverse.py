"""The traverse from one rest to the next: how far the pings taken under way say that the vehicle went.

Every displacement within reach is tried with walls as wide as a guess is wrong, the best ones are settled by least
squares over the whole path, and what several paths say alike or not is told as one normal.  In a smooth tunnel it is
as long as the tunnel is smooth.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from config.schema import Map
from mapping.compass import wrap
from mapping.course import Course, agreement, course_of
from mapping.grain import Grain, pull
from mapping.likeness import Likeness
from mapping.path import Floats, Pull, improve, inertia
from mapping.prior import Cloud
from mapping.sight import Sight, rise_m
from mapping.sketch import Sketch, followed_paths, sketch, smooth_paths
from mapping.values import Way

MOST = 12
"""Displacements that are settled by the shape of walls, ..."""
FOLLOWED = 6
"""... and those that are followed by their grain."""
SETTLE_M = (0.3, 0.15, 0.15)
"""How far marks may lie from the walls they are bound to, from first to last ..."""
ROUNDS = 2
"""... for so many rounds each."""
TEMPER = 0.2
"""Power of the likelihood between settled paths: each errs in its own way."""
FALSE = 0.06
"""Along a smooth passage walls seem to tell this share of what they tell across it: their normals are not known to
better, and hundreds of them err to no purpose.  It is taken off ..."""
SMOOTH_SD_M = 1.5
"""... where no less than this may be unknown ..."""
ALONE, ELSEWHERE_M = 45.0, 0.4
"""... unless no path that ends so far from the best one comes within this log-likelihood of it."""
WIDEN = 1.5
"""A settled path is too sure of itself: the standard deviation is multiplied by this ..."""
LEAST_SD_M = 0.02
"""... and is no less than this."""
UNSURE = 5.0
"""Log-likelihood ratio by which one of many wrong paths sounds alike by chance: less than this says nothing."""
HEARD_TEMPER, HEARD_WIDEN = 0.15, 2.0
"""Where walls were heard too, their shape decides less, and paths err in what both say."""
BEYOND = 1.2
"""Displacements are tried up to so many times the pilot's reach."""
GAP_S = 5.0
"""After a pause of this the way was not seen."""
RISE_M = 0.3
LONGEST_S = 120.0
"""Of longer ways too few knots would be told."""


@dataclass(frozen=True, slots=True)
class Settled:
    """A ``path`` ``(states, 3)`` that least squares have settled, ``covariance`` ``(2, 2)`` of its end, its height.

    ``like`` is how much likelier it is that walls along it sound alike than that each look hears its own.
    """

    path: Floats
    covariance: Floats
    height: float
    like: float = -math.inf

    @property
    def end_m(self) -> Floats:
        """Displacement ``(2,)``."""
        return self.path[-1, :2]


def traverse(here: Sight, there: Sight, way: Way, config: Map) -> Cloud | None:
    """Tell the displacement from one rest to the other, east and north by the compass.

    None where a part of the way was not seen, or where the vehicle went up or down: wells taper.
    """
    pauses_s = np.diff(way.t_ns) * 1e-9
    if len(pauses_s) == 0 or pauses_s.max() > GAP_S or pauses_s.sum() > LONGEST_S:
        return None
    if rise_m(here.scan, there.scan) > RISE_M:
        return None
    course = course_of(here, there, way, config)
    turned_rad = wrap(there.scan.heading_rad - here.scan.heading_rad)
    prior = inertia(course.seconds, course.knots, turned_rad)
    reach_m = BEYOND * config.reach_m
    tried = sketch(course, reach_m)
    seen = [settle(start, course, prior) for start in smooth_paths(course, tried, MOST)]
    if course.grain is not None and not is_alone(seen):
        heard = listen(course, course.grain, tried, prior, reach_m)
        if max(each.like for each in heard) > UNSURE:
            return joined(heard, HEARD_TEMPER, HEARD_WIDEN)
    return joined(seen, TEMPER, WIDEN)


def listen(course: Course, grain: Grain, tried: Sketch, prior: Floats, reach_m: float) -> list[Settled]:
    """Settle paths by the shape of walls and by their grain together, and tell how alike walls sound along them."""
    starts = followed_paths(course, grain, tried, reach_m, FOLLOWED) + smooth_paths(course, tried, FOLLOWED)
    likeness = Likeness(grain)
    settled = [settle(start, course, prior, partial(pull, grain)) for start in starts]
    return [replace(each, like=likeness.of(each.path)) for each in settled]


def joined(settled: list[Settled], temper: float, widen: float) -> Cloud:
    """Join what settled paths say as one normal."""
    like = np.array([each.like for each in settled])
    height = temper * np.array([each.height for each in settled]) + np.logaddexp(UNSURE, like)
    weight = np.exp(height - height.max())
    weight /= weight.sum()
    ends = np.array([each.end_m for each in settled])
    mean = weight @ ends
    off = ends - mean
    sure = is_alone(settled)
    told = [each.covariance if sure or each.like > UNSURE else sobered(each.covariance) for each in settled]
    own = np.tensordot(weight, np.array(told), axes=1)
    covariance = (weight[:, None] * off).T @ off + widen**2 * own + LEAST_SD_M**2 * np.eye(2)
    return Cloud(float(mean[0]), float(mean[1]), covariance)


def settle(path: Floats, course: Course, prior: Floats, drawn: Pull | None = None) -> Settled:
    """Settle a path by least squares, and tell how well it fits."""
    information = prior
    for reach_m in SETTLE_M:
        path, information = improve(path, course.marks.along(path), prior, reach_m, ROUNDS, drawn)
    moves = path.ravel()
    height = agreement(path, course) - 0.5 * float(moves @ prior @ moves)
    covariance = np.asarray(np.linalg.inv(information[3:, 3:])[-3:-1, -3:-1], dtype=np.float64)
    return Settled(path, covariance, height)


def sobered(covariance: Floats) -> Floats:
    """Take from what is known of a displacement ``(2, 2)`` what walls only seem to tell."""
    variance, axes = np.linalg.eigh(covariance)
    along, across = 1.0 / variance[1], 1.0 / variance[0]
    information = [across, max(along - FALSE * across, SMOOTH_SD_M**-2)]
    return np.asarray(axes @ np.diag(1.0 / np.array(information)) @ axes.T, dtype=np.float64)


def is_alone(settled: list[Settled]) -> bool:
    """Tell whether all paths that fit end at one place."""
    ends, height = np.array([each.end_m for each in settled]), np.array([each.height for each in settled])
    best = int(np.argmax(height))
    elsewhere = np.hypot(*(ends - ends[best]).T) > ELSEWHERE_M
    return bool(height[best] - height[elsewhere].max(initial=-math.inf) >= ALONE)
