"""A chart: what the stations of one piece saw together, and where another scan fits into it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from config.schema import Map
from mapping import grid as grids
from mapping.prior import Cloud, Prior
from mapping.register import ELSEWHERE_M, Match, register
from mapping.sight import Sight, rise_m, shifted
from mapping.values import Pose, Station, Way
from mapping.view import Field, View, field_of, points_of, to_map
from mapping.way import Walk

LEVEL_M = 0.5
"""Scans whose depths differ by more see other walls: wells taper."""
TAPER = 0.5
"""Largest widening of the walls per metre of depth ..."""
TAPER_STEPS = 4
"""... tried in so many steps to either side."""
LEAST_PARTICLES = 200

Charted = tuple[Station, Sight]


class Chart:
    """The stations of one piece as a reference for others."""

    def __init__(self, charted: Sequence[Charted], config: Map) -> None:
        self._charted = charted
        self._config = config

    def match(self, sight: Sight, prior: Prior, rng: np.random.Generator) -> Match:
        """Register a scan in what the stations at its own level saw; without any, in what the others saw."""
        level = self._level(sight)
        reference = self._reference(level or self._charted, prior, sight)
        if level:
            return register(sight.view, reference, prior, self._config.particles, rng)
        rise = min(rise_m(sight.scan, station.scan) for station, _ in self._charted)
        tapers = np.arange(-TAPER_STEPS, TAPER_STEPS + 1) * (TAPER * rise / TAPER_STEPS)
        views = [shifted(sight, float(taper), self._config).view for taper in tapers]
        particles = max(LEAST_PARTICLES, self._config.particles // 3)
        return best_of([register(view, reference, prior, particles, rng) for view in views])

    def walk(self, base: Station, ways: Sequence[Way], rng: np.random.Generator) -> Cloud | None:
        """Carry a cloud from a station along ways; None where one of them was not seen whole."""
        near = [(s, sight) for s, sight in self._charted if rise_m(s.scan, base.scan) <= LEVEL_M]
        walk = Walk(base.pose, base.scan.heading_rad, self._field(near), rng)
        return walk.cloud if all(walk.follow(way, self._config) for way in ways) else None

    def _level(self, sight: Sight) -> list[Charted]:
        return [(s, other) for s, other in self._charted if rise_m(sight.scan, s.scan) <= LEVEL_M]

    def _field(self, charted: Sequence[Charted]) -> Field:
        return field_of(grids.render([(station.pose, sight.evidence) for station, sight in charted], self._config))

    def _reference(self, charted: Sequence[Charted], prior: Prior, sight: Sight) -> View:
        """Make what the stations saw, as far as the scan may have seen it, into one view."""
        xy = np.concatenate([to_map(station.pose, other.view.points.xy_m) for station, other in charted])
        trust = np.concatenate([other.view.points.trust for _, other in charted])
        own = sight.view.points.xy_m
        reach = prior.reach_m * (3.0 if prior.gaussian else 1.0) + float(np.hypot(own[:, 0], own[:, 1]).max()) + 1.0
        near = np.hypot(xy[:, 0] - prior.x_m, xy[:, 1] - prior.y_m) < reach
        return View(points_of(xy[near], trust[near]), self._field(charted))


def best_of(matches: list[Match]) -> Match:
    """Choose among matches of one scan under several assumptions; the margin is over all poses elsewhere."""
    best = max(matches, key=lambda m: m.height)
    poses = [(m.pose, m.height) for m in matches] + [(m.other, m.height - m.margin) for m in matches]
    far = [height for pose, height in poses if apart_m(pose, best.pose) > ELSEWHERE_M]
    return replace(best, margin=best.height - max(far, default=-math.inf))


def apart_m(a: Pose, b: Pose) -> float:
    """Distance of two poses."""
    return math.hypot(a.x_m - b.x_m, a.y_m - b.y_m)
