"""The course from one rest to the next: what was seen at both and on the way between, and how well a path fits it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from config.schema import Map
from mapping import grid as grids
from mapping.grain import Grain, grain_of, levels
from mapping.path import HERE, KNOT_S, THERE, WITNESS, Floats, Ints, Marks, bonds_of
from mapping.sight import Sight, grounded
from mapping.values import Pose, Way
from mapping.view import TRUSTED_SD_M, VAGUE_SD_M, Field, field_of, from_map, to_map
from mapping.way import ranges_of

MOST_KNOTS = 64
MOST_MARKS = 600
"""Of a longer way every second beam is a mark, or every third: a way must not take longer than it took."""
CLEAR = 0.3
"""Wall points of a rest with less trust are no marks."""
FINE_M = 0.03
"""Width of walls where marks are bound along them."""
BOUND_M = 0.15
HIT_FREE, HIT_UNKNOWN = 0.05, 0.3
"""Odds of a mark in water that was seen free, and where nothing is known, against 1 at a wall."""
LEAST_KNOWN = 0.4
"""Share of the marks, by trust, below which it counts against a path that little of them is known elsewhere."""
HULL_M = 0.12
"""A mark nearer to the path than this is a wall that the vehicle went through ..."""
THROUGH = 2.0
"""... which costs so much of the log-likelihood."""


@dataclass(frozen=True, slots=True)
class Course:
    """A way cut into ``knots``, ``seconds`` long, with the marks of both rests and of the way between them.

    ``here`` and ``there`` are the fields of the two rests, in the compass's axes; ``grain`` is how loud walls answered.
    """

    here: Field
    there: Field
    marks: Marks
    seconds: float
    knots: int
    grain: Grain | None

    def when(self) -> Floats:
        """Give the moment of each mark ``(n,)``, 0 at the first rest and 1 at the second."""
        at = (self.marks.state - 1 + self.marks.share) / (self.knots - 1)
        return np.clip(np.where(self.marks.group == HERE, 0.0, at), 0.0, 1.0)


def course_of(here: Sight, there: Sight, way: Way, config: Map) -> Course:
    """Gather the marks of two rests and of the way between them."""
    since_s = (way.t_ns - way.t_ns[0]) * 1e-9
    seconds = max(float(since_s[-1]), 4.0 * KNOT_S)
    knots = min(math.ceil(seconds / KNOT_S) + 1, MOST_KNOTS)
    range_m, trust = ranges_of(way, config)
    heard = np.flatnonzero(np.isfinite(range_m))
    heard = heard[:: max(1, math.ceil(len(heard) / MOST_MARKS))]
    at = np.minimum(since_s / seconds * (knots - 1), knots - 1 - 1e-9)[heard]
    turned = np.abs(np.diff(np.unwrap(way.direction_rad), prepend=way.direction_rad[:1])).cumsum()[heard]
    direction, z = way.direction_rad[heard], range_m[heard]
    parts = (_at_rest(here, 0, HERE), _at_rest(there, knots + 1, THERE))
    state = at.astype(np.intp)
    marks = Marks(
        np.concatenate([*(p.arm_m for p in parts), np.stack([z * np.sin(direction), z * np.cos(direction)], axis=1)]),
        np.concatenate([*(p.trust for p in parts), trust[heard]]),
        np.concatenate([*(p.normal_rad for p in parts), np.full(len(z), np.nan)]),
        np.concatenate([*(p.state for p in parts), state + 1]),
        np.concatenate([*(p.share for p in parts), at - state]),
        np.concatenate([*(p.group for p in parts), (turned / math.pi).astype(np.intp) + 1]),
    )
    grain = _grain(here, there, way, marks, (range_m[heard], heard))
    return Course(_field(here, config), _field(there, config), marks, seconds, knots, grain)


def _grain(here: Sight, there: Sight, way: Way, marks: Marks, under_way: tuple[Floats, Ints]) -> Grain | None:
    """Gather how loud walls answered: at both rests every clear return, and under way those that are marks."""
    range_m, beams = under_way
    moving = marks.group > HERE
    parts = [_looks(here, 0, HERE), _looks(there, int(marks.state.max()), THERE)]
    looks = Marks(
        np.concatenate([*(look.arm_m for look, _ in parts), marks.arm_m[moving]]),
        np.concatenate([*(look.trust for look, _ in parts), marks.trust[moving]]),
        np.concatenate([*(look.normal_rad for look, _ in parts), marks.normal_rad[moving]]),
        np.concatenate([*(look.state for look, _ in parts), marks.state[moving]]),
        np.concatenate([*(look.share for look, _ in parts), marks.share[moving]]),
        np.concatenate([*(look.group for look, _ in parts), marks.group[moving]]),
    )
    level = np.concatenate([*(level for _, level in parts), levels(way.echoes[beams], range_m, way.bin_m)])
    return grain_of(looks, level)


def _looks(sight: Sight, state: int, group: int) -> tuple[Marks, Floats]:
    """Give the returns of a rest, in axes of the compass, and their levels."""
    returns, scan = sight.returns, sight.scan
    clear = np.flatnonzero(np.isfinite(returns.range_m) & (np.nan_to_num(returns.sd_m, nan=1.0) < VAGUE_SD_M))
    range_m, direction = returns.range_m[clear], scan.heading_rad + scan.bearing_rad[clear]
    n = len(clear)
    arm = np.stack([range_m * np.sin(direction), range_m * np.cos(direction)], axis=1)
    trust = np.minimum(1.0, TRUSTED_SD_M / np.maximum(returns.sd_m[clear], 1e-6))
    looks = Marks(arm, trust, np.full(n, np.nan), np.full(n, state), np.zeros(n), np.full(n, group))
    return looks, levels(scan.echoes[clear], range_m, scan.bin_m)


def _field(sight: Sight, config: Map) -> Field:
    return field_of(grids.render([(Pose(0.0, 0.0, sight.scan.heading_rad), sight.ground)], grounded(config)))


def _at_rest(sight: Sight, state: int, group: int) -> Marks:
    points = sight.view.points
    clear = points.trust > CLEAR
    heading = sight.scan.heading_rad
    n = int(clear.sum())
    arm = to_map(Pose(0.0, 0.0, heading), points.xy_m[clear])
    normal = points.normal_rad[clear] - heading  # of axes that turn counter-clockwise
    return Marks(arm, points.trust[clear], normal, np.full(n, state), np.zeros(n), np.full(n, group))


def agreement(path: Floats, course: Course) -> float:
    """Log-likelihood of the marks along a path: those that are known to both rests agree, or not, for all of them.

    What falls where nothing is known must not count for a path, nor against it: along a passage the path on which the
    vehicle did not move at all has most in common with itself.
    """
    marks = course.marks.along(path)
    places, _ = marks.places(path)
    bonds = bonds_of(marks, places, BOUND_M)
    near = np.exp(-0.5 * (bonds.off_m / FINE_M) ** 2)
    total = known = every = 0.0
    for field, group, at in ((course.here, HERE, path[0]), (course.there, THERE, path[-1])):
        best, bound = np.zeros(len(places)), np.zeros(len(places), dtype=bool)
        for side, other in ((bonds.one, bonds.other), (bonds.other, bonds.one)):
            here = (marks.group[other] == group) & (marks.group[side] != group)
            np.maximum.at(best, side[here], near[here])
            bound[side[here]] = True
        odds = best + np.where(bound, 0.5 * HIT_UNKNOWN, np.where(_free(field, at, places), HIT_FREE, HIT_UNKNOWN))
        told = bound | (odds == HIT_FREE)
        trust = marks.trust * (marks.group != group)
        total += float((trust * told) @ np.log(odds / HIT_UNKNOWN))
        known += float(trust @ told)
        every += float(trust.sum())
    return WITNESS * total * every / max(known, LEAST_KNOWN * every, 1e-9) - THROUGH * _gone_through(
        path, marks, places
    )


def _free(field: Field, at: Floats, places: Floats) -> NDArray[np.bool_]:
    xy = from_map(Pose(float(at[0]), float(at[1]), float(at[2])), places)
    return field.free.ravel().take(field.cells(xy[:, 0], xy[:, 1]))


def _gone_through(path: Floats, marks: Marks, places: Floats) -> float:
    """Trust of the marks that lie on the path."""
    fine = np.linspace(0.0, len(path) - 1, 4 * len(path))
    x, y = (np.interp(fine, np.arange(len(path)), path[:, k]) for k in (0, 1))
    apart = np.hypot(places[:, :1] - x, places[:, 1:] - y).min(axis=1)
    return float(marks.trust[apart < HULL_M].sum())
