"""A chart: what the stations of one piece saw together about a place, and where another scan fits into it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import islice
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from config.schema import Map
from mapping.compass import wrap
from mapping.grid import Canvas, gather
from mapping.likelihood import Likelihood, Posterior
from mapping.modes import ELSEWHERE_M, ELSEWHERE_RAD
from mapping.pieces import LEVEL_M, Pieces, sd_m
from mapping.prior import Prior
from mapping.register import Match, challenged, register
from mapping.search import search
from mapping.sight import Sight, grounded, rise_m
from mapping.taper import best_scaled
from mapping.values import Pose
from mapping.view import Field, Points, View, field_of, points_of, to_map

NEIGHBOURS = 6
"""Stations, those nearest, that make a reference: with all, a scan would take longer as the dive goes on."""
KEPT = 4 * NEIGHBOURS
"""Stations of which the cells are kept."""
POINTS = 250
"""Points of a reference: more would take longer, and tell no more."""
SURE_M = 0.3
"""Stations that lie to the one next in time less surely make no reference with it: their walls would be double."""
SAME_LEVEL_M = 0.2
"""Where none is of a scan's level, those are that are within this of the nearest level."""
LEAST_PARTICLES = 200

Floats = NDArray[np.float64]


class Charts:
    """References of several stations, drawn from what is kept of them."""

    def __init__(self, pieces: Pieces, config: Map) -> None:
        # Not the map's canvas: the map has its own axes, and each would be drawn anew after the other.
        self._pieces, self._canvas, self._config = pieces, Canvas(grounded(config), KEPT), grounded(config)
        self._last: tuple[tuple[object, ...], View] | None = None

    def match(self, sight: Sight, base: int, prior: Prior, rng: np.random.Generator) -> Match:
        """Register a scan in what stations about its prior, tied to ``base``, saw at its level; or else in others'."""
        held = self.about(base, (prior.x_m, prior.y_m), sight)
        reference = self.reference(held, prior, sight)
        if rise_m(sight.scan, self._pieces.sight(held[0]).scan) <= LEVEL_M:
            alone = None if held == [base] else self.alone(sight, base, prior)
            return register(sight.view, reference, prior, self._config.particles * prior.effort, rng, alone)
        rise = min(rise_m(sight.scan, self._pieces.sight(k).scan) for k in held)
        particles = max(LEAST_PARTICLES, self._config.particles // 3) * prior.effort

        def fit(view: View) -> Match:
            return register(view, reference, prior, particles, rng)

        return best_of(best_scaled(sight, reference, rise, self._config, fit))

    def rival(self, sight: Sight, base: int, prior: Prior, match: Match, rng: np.random.Generator) -> float:
        """Tell the log-posterior of the best pose elsewhere than a match, where the prior is another than its own."""
        held = self.about(base, (prior.x_m, prior.y_m), sight)
        if rise_m(sight.scan, self._pieces.sight(held[0]).scan) > LEVEL_M:
            found = self.match(sight, base, prior, rng)
            same = apart_m(found.pose, match.pose) <= ELSEWHERE_M
            return found.height - found.margin if same else found.height
        like = Likelihood(sight.view, self.reference(held, prior, sight), prior)
        barred = np.array([[match.pose.x_m, match.pose.y_m, match.pose.heading_rad]])
        return search(like, prior, self._config.particles // 2 * prior.effort, rng, barred)[1]

    def alone(self, sight: Sight, base: int, prior: Prior) -> Likelihood:
        """Hold a scan against what one station saw, by itself."""
        return Likelihood(sight.view, self._pieces.sight(base).view, prior, self._pieces.pose(base))

    def about(self, base: int, xy_m: tuple[float, float], sight: Sight) -> list[int]:
        """Stations nearest to a place, of a scan's level if there are any, that lie to ``base`` surely."""
        solution = self._pieces.solution(base)
        rise = {k: rise_m(sight.scan, self._pieces.sight(k).scan) for k in solution.stations}
        level = [k for k in solution.stations if rise[k] <= max(LEVEL_M, min(rise.values()) + SAME_LEVEL_M)]
        near = sorted(level, key=lambda k: (_away_m(self._pieces.pose(k), xy_m), k))
        sure = (k for k in near if k == base or sd_m(solution.between(base, k)) <= SURE_M)
        return list(islice(sure, NEIGHBOURS)) or near[:NEIGHBOURS]

    def reference(self, held: Sequence[int], prior: Prior, sight: Sight) -> View:
        """Make what stations saw, as far as a scan may have seen it, into one view."""
        at = (prior.x_m, prior.y_m, prior.reach_m, prior.gaussian)
        key = (sight.scan.index, at, *((k, self._pieces.pose(k)) for k in held))
        if self._last is None or self._last[0] != key:
            self._last = key, self._drawn(held, prior, sight)
        return self._last[1]

    def _drawn(self, held: Sequence[int], prior: Prior, sight: Sight) -> View:
        views = [(self._pieces.pose(k), self._pieces.sight(k).view) for k in held]
        xy = np.concatenate([to_map(pose, view.points.xy_m) for pose, view in views])
        trust = np.concatenate([view.points.trust for _, view in views])
        own = sight.view.points.xy_m
        reach = prior.reach_m * (3.0 if prior.gaussian else 1.0) + float(np.hypot(own[:, 0], own[:, 1]).max()) + 1.0
        near = np.hypot(xy[:, 0] - prior.x_m, xy[:, 1] - prior.y_m) < reach
        return View(_fewer(points_of(xy[near], trust[near])), self._field(held))

    def _field(self, held: Sequence[int]) -> Field:
        drawn = [self._canvas.cells(self._pieces.pose(k), self._pieces.sight(k).ground) for k in held]
        return field_of(gather(drawn, self._config))


def _fewer(points: Points) -> Points:
    """Let each of some points speak for several, where there are many: their weights then add up to more than 1."""
    n = len(points.xy_m)
    kept = np.linspace(0.0, n - 1.0, min(n, POINTS)).astype(np.intp)
    weight = points.weight[kept] * (n / max(len(kept), 1)) / max(float(points.weight[kept].sum()), 1e-9)
    return Points(points.xy_m[kept], points.trust[kept] * (n / max(len(kept), 1)), weight, points.normal_rad[kept])


class Found(Protocol):
    """An answer of a registration: a pose, and its log-posterior."""

    @property
    def pose(self) -> Pose:
        """The best pose."""

    @property
    def height(self) -> float:
        """Its log-posterior."""


def doubted(found: Found, best: Floats, whole: Posterior, alone: Posterior) -> float:
    """Tell the margin that is left when the scan before is heard alone, where its ``best`` pose is elsewhere.

    Where much is known, a scan finds its like; a place at the edge of what is known, where it truly is, has less to
    show for itself.  The scan before knows least, and so is drawn least to where much is known.
    """
    pose = np.array([found.pose.x_m, found.pose.y_m, found.pose.heading_rad])
    if math.hypot(*(best - pose)[:2]) < ELSEWHERE_M and abs(wrap(float(best[2] - pose[2]))) < ELSEWHERE_RAD:
        return math.inf
    against = max(0.0, _height(alone, best) - _height(alone, pose))
    return found.height - _height(whole, best) - against


def _height(like: Posterior, pose: Floats) -> float:
    """Largest log-posterior about a pose."""
    steps = np.stack(np.meshgrid(*[np.arange(-2, 3)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    return float(like.log_posterior(pose + steps * [0.05, 0.05, math.radians(1.0)]).max())


def best_of(matches: list[Match]) -> Match:
    """Choose among matches of one scan under several assumptions; the margin is over all poses elsewhere."""
    best = max(matches, key=lambda m: m.height)
    poses = [(m.pose, m.height) for m in matches] + [(m.other, m.height - m.margin) for m in matches]
    far = [height for pose, height in poses if apart_m(pose, best.pose) > ELSEWHERE_M]
    return challenged(best, max(far, default=-math.inf))


def apart_m(a: Pose, b: Pose) -> float:
    """Distance of two poses."""
    return math.hypot(a.x_m - b.x_m, a.y_m - b.y_m)


def _away_m(pose: Pose, xy_m: tuple[float, float]) -> float:
    return math.hypot(pose.x_m - xy_m[0], pose.y_m - xy_m[1])
