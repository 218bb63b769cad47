"""The traverse from one rest to the next: how far the pings taken under way say that the vehicle went.

Every displacement within reach is tried with walls as wide as a guess is wrong, the best ones are settled by least
squares over the whole path, and what several paths say alike or not is told as one normal.  In a smooth tunnel it is
as long as the tunnel is smooth.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from config.schema import Map
from mapping.compass import wrap
from mapping.course import HULL_M, LEAST_KNOWN, THROUGH, Course, agreement, course_of
from mapping.path import HERE, THERE, WITNESS, Floats, improve, inertia
from mapping.prior import Cloud
from mapping.sight import Sight, rise_m
from mapping.values import Way

STEP_M = 0.15
SKETCH_M = 0.2
"""Width of walls while displacements are tried."""
LAGS = (0.0, 0.2, 0.4)
"""Shares of the way, in time, that the vehicle may yet be at rest."""
THIN = 2
BAND = 60.0
"""Log-likelihood below the best, from which a displacement is not settled."""
APART_M = 0.4
MOST = 12
"""Displacements that are settled."""
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
BEYOND = 1.2
"""Displacements are tried up to so many times the pilot's reach."""
GAP_S = 5.0
"""After a pause of this the way was not seen."""
RISE_M = 0.3
LONGEST_S = 120.0
"""Of longer ways too few knots would be told."""


@dataclass(frozen=True, slots=True)
class Settled:
    """A ``path`` ``(states, 3)`` that least squares have settled, ``covariance`` ``(2, 2)`` of its end, its height."""

    path: Floats
    covariance: Floats
    height: float

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
    settled = [settle(start, course, prior) for start in sketch(course, BEYOND * config.reach_m)]
    height = np.array([each.height for each in settled])
    weight = np.exp(TEMPER * (height - height.max()))
    weight /= weight.sum()
    ends = np.array([each.end_m for each in settled])
    mean = weight @ ends
    off = ends - mean
    told = [each.covariance if is_alone(ends, height) else sobered(each.covariance) for each in settled]
    own = np.tensordot(weight, np.array(told), axes=1)
    covariance = (weight[:, None] * off).T @ off + WIDEN**2 * own + LEAST_SD_M**2 * np.eye(2)
    return Cloud(float(mean[0]), float(mean[1]), covariance)


def settle(path: Floats, course: Course, prior: Floats) -> Settled:
    """Settle a path by least squares, and tell how well it fits."""
    information = prior
    for reach_m in SETTLE_M:
        path, information = improve(path, course.marks.along(path), prior, reach_m, ROUNDS)
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


def is_alone(ends: Floats, height: Floats) -> bool:
    """Tell whether all paths that fit end at one place."""
    best = int(np.argmax(height))
    elsewhere = np.hypot(*(ends - ends[best]).T) > ELSEWHERE_M
    return bool(height[best] - height[elsewhere].max(initial=-math.inf) >= ALONE)


def sketch(course: Course, reach_m: float) -> list[Floats]:
    """Give paths ``(states, 3)``, straight and smooth in time, to those displacements that fit best."""
    side = np.arange(-reach_m, reach_m + 1e-9, STEP_M)
    x, y = np.meshgrid(side, side)
    ends = np.stack([x.ravel(), y.ravel()], axis=1)
    ends = ends[np.hypot(ends[:, 0], ends[:, 1]) <= reach_m]
    heights = np.array([_heights(course, ends, lag) for lag in LAGS])
    best, lag = heights.max(axis=0), heights.argmax(axis=0)
    order = np.argsort(-best, kind="stable")
    chosen = _spread(ends, order[best[order] > best.max() - BAND])
    return [_smooth(course, ends[k], LAGS[lag[k]]) for k in chosen]


def _spread(ends: Floats, order: NDArray[np.intp]) -> list[int]:
    """Choose displacements in order, none near another."""
    chosen: list[int] = []
    for k in order:
        if len(chosen) < MOST and all(math.hypot(*(ends[k] - ends[j])) > APART_M for j in chosen):
            chosen.append(int(k))
    return chosen


def _smooth(course: Course, end: Floats, lag: float) -> Floats:
    path = np.zeros((course.knots + 2, 3))
    path[1:-1, :2] = _gone(np.linspace(0.0, 1.0, course.knots), lag)[:, None] * end
    path[-1, :2] = end
    return path


def _gone(when: Floats, lag: float) -> Floats:
    """Share of the way that is gone at moments from 0 to 1, with a smooth start and stop."""
    share = np.clip((when - lag) / (1.0 - lag), 0.0, 1.0)
    return np.asarray(share**3 * (10.0 - 15.0 * share + 6.0 * share**2), dtype=np.float64)


def _heights(course: Course, ends: Floats, lag: float) -> Floats:
    """Log-likelihood ``(n,)`` of smooth paths to displacements ``(n, 2)``, by walls of ``SKETCH_M``."""
    marks, gone = course.marks, _gone(course.when(), lag)
    total, known = np.zeros(len(ends)), np.zeros(len(ends))
    every = 0.0
    for field, group in ((course.here, HERE), (course.there, THERE)):
        kept = np.flatnonzero(marks.group != group)[::THIN]
        trust, arm = THIN * marks.trust[kept], marks.arm_m[kept]
        share = gone[kept] - (0.0 if group == HERE else 1.0)
        cells = field.cells(*(ends[:, k : k + 1] * share + arm[:, k] for k in (0, 1)))
        scores, told = field.scores(SKETCH_M).ravel(), field.known().ravel().take(cells)
        total += (scores.take(cells) * told) @ trust
        known += told @ trust
        every += float(trust.sum())
    through = _through(ends, marks.arm_m[::THIN], gone[::THIN], THIN * marks.trust[::THIN])
    return WITNESS * total * every / np.maximum(known, LEAST_KNOWN * every + 1e-9) - THROUGH * through


def _through(ends: Floats, arm_m: Floats, gone: Floats, trust: Floats) -> Floats:
    """Trust ``(n,)`` of the marks that lie on straight ways to displacements ``(n, 2)``."""
    length2 = np.maximum((ends**2).sum(axis=1), 1e-6)[:, None]
    along = ends @ arm_m.T
    share = np.clip(along / length2, -gone, 1.0 - gone)
    apart2 = (arm_m**2).sum(axis=1) - 2.0 * share * along + share**2 * length2
    return np.asarray((apart2 < HULL_M**2) @ trust, dtype=np.float64)
