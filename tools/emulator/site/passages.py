"""Passages: longer than the sonar sees, and much alike from place to place."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np

from tools.emulator.site.curves import Curve, beside, smooth
from tools.emulator.site.shapes import rectangle, rock_cut, stop
from tools.emulator.site.values import PLASTER, Points, Site, Stop, Wall

_NICHES: Final = ((2.6, 1), (6.2, -1), (9.4, 1), (14.8, -1), (17.0, 1), (21.3, 1), (27.9, -1), (31.2, 1), (37.4, -1))
"""Niches of the gallery: distance from its beginning in m, and side (1 is right)."""


def gallery() -> Site:
    """Return a winding water gallery of some 45 m with niches, a little over a metre wide.

    In size and character the qanat of the paper's table 1 (562 x 162 cells, over 40 m, more than 20 scans).
    """
    course = smooth([(0, 0), (7, 1.4), (14, -0.3), (21, 0.9), (27, 4.2), (33, 7.0), (39, 7.3), (43, 6.2)], closed=False)
    along = course.distance_m
    half = 0.66 + 0.06 * np.sin(along * 0.9) + 0.04 * np.sin(along * 2.3)
    right, left = (half + 0.65 * _niches(along, side) for side in (1, -1))
    outline = [*beside(course, right).tolist(), *beside(course, -left)[::-1].tolist()]
    wall = rock_cut([(x, y) for x, y in outline], np.random.default_rng(562), facet_m=0.3, roughness_m=0.03)
    out = [_on(course, at, 0.06 * (-1) ** number) for number, at in enumerate(np.arange(1.2, 44.0, 2.05))]
    back = [_on(course, at, 0.0, turned=True) for at in (out[-1][0] - 1.1, out[-1][0] - 3.2)]
    return Site("gallery", (wall,), floor_m=2.0, stops=tuple(each for _, each in [*out, *back]))


def loop() -> Site:
    """Return two entries joined by two divergent channels around a rock, over 15 m across.

    In size and character Tas Silg of the paper's table 1 (187 x 175 cells): entries in the west and the east.
    """
    ring = smooth(
        [
            (-6.6, -2.6),
            (-5.6, 0.6),
            (-2.8, 3.0),
            (0.8, 4.1),
            (4.4, 4.0),
            (6.8, 2.2),
            (5.4, -0.6),
            (2.0, -2.2),
            (-2.2, -3.6),
        ],
        closed=True,
    )
    arm = np.minimum(*(np.hypot(*(ring.points_m - entry).T) for entry in np.array([(-6.6, -2.6), (6.8, 2.2)])))
    outer = 0.72 + 0.9 * np.exp(-((arm / 1.6) ** 2))
    rng = np.random.default_rng(187)
    walls = [
        rock_cut([(x, y) for x, y in beside(ring, offset).tolist()], rng, roughness_m=0.03)
        for offset in (-outer, np.full(len(arm), 0.66))
    ]
    apart = float(ring.distance_m[-1]) / 14
    first, *later = (_on(ring, number % 14 * apart, 0.0)[1] for number in range(15))
    ways = (ring.at((number + 0.5) * apart, 0.0)[:2] for number in range(14))
    stops = (first, *(replace(each, via_m=(way,)) for each, way in zip(later, ways, strict=True)))
    return Site("loop", tuple(walls), floor_m=2.4, stops=stops)


def tunnel() -> Site:
    """Return a straight plastered tunnel, 44 x 1.8 m, flooded to its roof: nothing tells how far along it one is.

    From no stop is an end within 10 m.
    """
    stops = tuple(
        stop(x, y, deg)
        for x, y, deg in (
            (-9.0, 0.1, 90.0),
            (-6.7, -0.1, 85.0),
            (-4.2, 0.0, 92.0),
            (-1.8, 0.15, 90.0),
            (0.7, 0.0, 95.0),
            (3.1, -0.1, 88.0),
            (5.6, 0.0, 90.0),
            (8.2, 0.1, 90.0),
            (6.1, 0.0, 270.0),
        )
    )
    wall = Wall(np.array(rectangle(-22.0, -0.9, 22.0, 0.9)))
    return Site("tunnel", (wall,), floor_m=2.3, stops=stops, material=PLASTER, ceiling_m=0.4)


def _niches(along_m: Points, side: int, width_m: float = 1.0) -> Points:
    """One where a niche is, zero elsewhere, with walls that take a hand's breadth."""
    depth = [
        np.clip((width_m / 2 + 0.06 - np.abs(along_m - at)) / 0.12, 0.0, 1.0) for at, its in _NICHES if its == side
    ]
    return np.asarray(np.max(depth, axis=0), dtype=np.float64)


def _on(course: Curve, at_m: float, right_m: float, *, turned: bool = False) -> tuple[float, Stop]:
    """Return the distance and the stop there, ``right_m`` beside the course and looking along it, or back."""
    x_m, y_m, course_deg = course.at(at_m, right_m)
    return at_m, stop(x_m, y_m, (course_deg + (180.0 if turned else 0.0)) % 360.0, depth_m=1.1)
