"""Displacements within reach, and which of them a way may have led to: the starts of paths that are then settled."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mapping.course import HULL_M, LEAST_KNOWN, THROUGH, Course
from mapping.grain import Grain
from mapping.path import HERE, THERE, WITNESS, Floats
from mapping.progress import Passage, Progress

STEP_M = 0.15
SKETCH_M = 0.2
"""Width of walls while displacements are tried."""
LAGS = (0.0, 0.2, 0.4)
"""Shares of the way, in time, that the vehicle may yet be at rest."""
THIN = 2
BAND = 60.0
"""Log-likelihood below the best, from which a displacement is not settled."""
APART_M = 0.4
FOLLOWED_APART_M = 0.3
LINE_POWER, CROSS_POWER, FAR_POWER = 0.1, 0.3, 0.02
"""Powers of the likelihood where a passage's line is found: of all displacements, of those as far, of the best."""


@dataclass(frozen=True, slots=True)
class Sketch:
    """Displacements ``ends`` ``(n, 2)``, how well a smooth path to each fits, and its lag."""

    ends: Floats
    height: Floats
    lag: Floats


def sketch(course: Course, reach_m: float) -> Sketch:
    """Try displacements within reach by walls of ``SKETCH_M``."""
    side = np.arange(-reach_m, reach_m + 1e-9, STEP_M)
    x, y = np.meshgrid(side, side)
    ends = np.stack([x.ravel(), y.ravel()], axis=1)
    ends = ends[np.hypot(ends[:, 0], ends[:, 1]) <= reach_m]
    heights = np.array([_heights(course, ends, lag) for lag in LAGS])
    return Sketch(ends, heights.max(axis=0), np.array(LAGS)[heights.argmax(axis=0)])


def smooth_paths(course: Course, tried: Sketch, most: int) -> list[Floats]:
    """Give paths ``(states, 3)``, straight and smooth in time, to those displacements that fit best."""
    order = np.argsort(-tried.height, kind="stable")
    fit = order[tried.height[order] > tried.height.max() - BAND]
    return [_smooth(course, tried.ends[k], float(tried.lag[k])) for k in _spread(tried.ends[fit], fit, APART_M, most)]


def followed_paths(course: Course, grain: Grain, tried: Sketch, reach_m: float, most: int) -> list[Floats]:
    """Give paths along a passage, either way, on which the grain of its walls was heard best."""
    ahead = line_of(tried)
    ways = [Progress(grain, line, reach_m, course.knots, course.seconds) for line in (ahead, ahead.back)]
    height = np.concatenate([way.height for way in ways])
    ends = np.concatenate([way.passage.at(way.far_m) for way in ways])
    count = len(ways[0].far_m)
    order = np.argsort(-height, kind="stable")
    chosen = _spread(ends[order], order, FOLLOWED_APART_M, most)
    return [_along(course, ways[k // count], k % count) for k in chosen]


def line_of(tried: Sketch) -> Passage:
    """Find the line of a passage: displacements along it fit alike."""
    weight = np.exp(LINE_POWER * (tried.height - tried.height.max()))
    axis = np.linalg.eigh((weight[:, None] * tried.ends).T @ tried.ends)[1][:, 1]
    along, across = tried.ends @ axis, tried.ends @ np.array([-axis[1], axis[0]])
    far = np.round(along / STEP_M).astype(np.intp)
    far -= far.min()
    top = np.full(int(far.max()) + 1, -math.inf)
    np.maximum.at(top, far, tried.height)
    share = np.exp(CROSS_POWER * (tried.height - top[far]))
    share *= np.exp(FAR_POWER * (top[far] - tried.height.max())) / np.bincount(far, share)[far]
    terms = np.stack([along, along**2], axis=1)
    held = (share[:, None] * terms).T @ terms + 1e-3 * np.eye(2)
    slope, bend = np.linalg.solve(held, (share * across) @ terms)
    return Passage(axis, float(slope), float(bend))


def _spread(ends: Floats, order: NDArray[np.intp], apart_m: float, most: int) -> list[int]:
    """Choose of displacements in ``order``, the best first, those that no better one is near to."""
    chosen: list[int] = []
    for k in range(len(order)):
        if len(chosen) < most and all(math.hypot(*(ends[k] - ends[j])) > apart_m for j in chosen):
            chosen.append(k)
    return [int(order[k]) for k in chosen]


def _along(course: Course, way: Progress, which: int) -> Floats:
    progress = way.best(which)
    moments = np.linspace(0.0, 1.0, course.knots)
    path = np.zeros((course.knots + 2, 3))
    path[1:-1, :2] = way.passage.at(np.interp(moments, np.linspace(0.0, 1.0, len(progress)), progress))
    path[-1, :2] = way.passage.at(way.far_m[which])
    return path


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
