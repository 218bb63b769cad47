"""The grain of walls: how loud each spot answers, a pattern that stays with the wall where its shape tells nothing.

What a level owes to range and incidence is taken off; what is left is the wall's own, and speckle.  Along emulated rock
and plaster two looks at one spot, metres apart, are alike by 0.6 and 0.45, and by half of that a hand's breadth on.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mapping.path import THERE, Bonds, Floats, Ints, Marks, derived, later
from mapping.view import normals

LEVEL_M = 0.06
"""A level is the mean over so much range to either side of a return."""
LEAST_COSINE = 0.3
"""Walls that are met flatter than this have no level of their own."""
MOST = 2.5
"""Levels are told in standard deviations, up to this."""
FEW = 40
"""Of fewer looks nothing can be said of what is usual."""
WIDTH_M = 0.09
"""Width over which looks at a wall are joined to a line of levels."""
LEAST_NEAR = 0.5
"""There is no such line where there are fewer looks than this, by their weights."""
ALIKE = 0.55
PULL = 0.4
"""Power of one look: neighbours share their speckle."""


@dataclass(frozen=True, slots=True)
class Grain:
    """Levels ``(n,)`` of walls at ``marks``, in standard deviations from what is usual at their range and incidence."""

    marks: Marks
    level: Floats


def levels(echoes: NDArray[np.uint8], range_m: Floats, bin_m: float) -> Floats:
    """Give the mean level ``(n,)`` of pings ``(n, bins)`` about a range each."""
    half = max(1, round(LEVEL_M / bin_m))
    middle = np.round(range_m / bin_m - 0.5).astype(np.intp)
    around = np.clip(middle[:, None] + np.arange(-half, half + 1), 0, echoes.shape[1] - 1)
    return np.asarray(np.take_along_axis(echoes, around, axis=1).mean(axis=1, dtype=np.float64))


def grain_of(looks: Marks, level: Floats) -> Grain | None:
    """Take off what levels ``(n,)`` owe to range and incidence, and leave out what is met too flat.

    None where there are too few looks, or where all are equally loud.
    """
    normal = np.full(len(level), np.nan)
    for group in np.unique(looks.group):
        of = looks.group == group
        normal[of] = normals(looks.arm_m[of])
    range_m = np.maximum(np.hypot(looks.arm_m[:, 0], looks.arm_m[:, 1]), 1e-3)
    cosine = np.abs(looks.arm_m[:, 0] * np.cos(normal) + looks.arm_m[:, 1] * np.sin(normal)) / range_m
    kept = np.flatnonzero(cosine > LEAST_COSINE)
    if len(kept) < FEW:
        return None
    c, r = cosine[kept], np.log(range_m[kept])
    usual = np.stack([np.ones_like(c), c, c**2, c**4, c**8, r, r**2], axis=1)
    own = level[kept] - usual @ np.linalg.lstsq(usual, level[kept], rcond=None)[0]
    spread = float(own.std())
    if spread < 1e-6:
        return None
    own = np.clip(own / spread, -MOST, MOST)
    of = replace(looks, arm_m=looks.arm_m[kept], trust=looks.trust[kept], normal_rad=normal[kept])
    marks = replace(of, state=looks.state[kept], share=looks.share[kept], group=looks.group[kept])
    return Grain(marks, own / own.std())


def pull(grain: Grain, path: Floats) -> tuple[Floats, Floats]:
    """Draw looks along walls to where others heard their like: information ``(3 states, 3 states)`` and its vector."""
    places, arms = grain.marks.places(path)
    apart = ((places[:, None, :] - places[None, :, :]) ** 2).sum(axis=2)
    near = np.exp(-0.5 * apart / WIDTH_M**2)
    parts = [_line(grain, places, near, group) for group in range(THERE, int(grain.marks.group.max()) + 1)]
    one, other, off, slope = (np.concatenate(each) for each in zip(*parts, strict=True))
    rows = derived(grain.marks, arms, Bonds(one, other, slope, off), len(path))
    power = PULL / (1.0 - ALIKE**2)
    return power * rows.T @ rows, power * rows.T @ off


def _line(grain: Grain, places: Floats, near: Floats, group: int) -> tuple[Ints, Ints, Floats, Floats]:
    """Hold later looks against the line of levels that one group heard: pairs, how far off, and how it changes."""
    of, one = np.flatnonzero(grain.marks.group == group), np.flatnonzero(later(grain.marks.group, group))
    weight = near[np.ix_(one, of)]
    total = weight.sum(axis=1)
    heard = total > LEAST_NEAR
    one, weight = one[heard], weight[heard] / total[heard, None]
    if not len(one):
        return one, one, np.zeros(0), np.zeros((0, 2))
    line = weight @ grain.level[of]
    steep = weight * (grain.level[of] - line[:, None])
    slope = (steep @ places[of] - steep.sum(axis=1)[:, None] * places[one]) / WIDTH_M**2
    return one, of[weight.argmax(axis=1)], grain.level[one] - ALIKE * line, -ALIKE * slope
