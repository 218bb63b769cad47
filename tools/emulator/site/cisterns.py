"""Cisterns: small, rock-cut or walled, entered through a shaft."""

from __future__ import annotations

from itertools import pairwise
from math import cos, radians, sin

import numpy as np

from tools.emulator.site.shapes import Outline, oval, rock_cut, stop
from tools.emulator.site.values import PLASTER, Site


def keyhole() -> Site:
    """Return a rock-cut cistern: an oval chamber and a straight passage that leaves it to the east.

    In character the keyhole cistern of the paper (150 x 100 cells of about 7 cm, 2.6 m of water).
    """
    half, mouth_deg = 0.75, 16.0
    chamber = oval((0.0, 0.0), 5.8, 5.3, 90.0 + mouth_deg, 450.0 - mouth_deg)
    passage = [(2.789, half), (6.7, half + 0.1), (6.75, -half), (2.789, -half)]
    wall = rock_cut(chamber + passage, np.random.default_rng(2011))
    stops = (
        stop(-1.1, -1.1, 350.0),
        stop(-0.9, 0.3, 20.0),
        stop(0.5, 1.2, 75.0),
        stop(0.6, -0.9, 130.0, depth_m=1.4),
        stop(1.9, 0.1, 95.0, depth_m=1.4),
        stop(3.3, 0.1, 88.0, depth_m=1.5),
        stop(4.9, 0.0, 85.0, depth_m=1.5),
        stop(3.0, -0.1, 268.0, depth_m=1.4),
    )
    return Site("keyhole", (wall,), floor_m=2.6, stops=stops)


def house() -> Site:
    """Return the small rectangular cistern of a house: plastered walls, a recess for buckets, 2.2 m of water.

    Of the kind that the paper has from private homes; 5.2 x 3.4 m.
    """
    outline = [(-2.6, -1.7), (-2.6, 1.7), (0.6, 1.7), (0.6, 2.4), (1.6, 2.4), (1.6, 1.7), (2.6, 1.7), (2.6, -1.7)]
    wall = rock_cut(outline, np.random.default_rng(1748), roughness_m=0.012)
    stops = (
        stop(-1.5, -0.6, 5.0, depth_m=1.0),
        stop(-0.6, 0.6, 60.0, depth_m=1.0),
        stop(0.9, 0.8, 95.0, depth_m=1.1),
        stop(1.5, -0.5, 170.0, depth_m=1.2),
        stop(0.0, -0.8, 265.0, depth_m=1.1),
        stop(-1.4, 0.3, 320.0, depth_m=1.0),
    )
    return Site("house", (wall,), floor_m=2.2, stops=stops, material=PLASTER)


def bell() -> Site:
    """Return a bell-shaped well: round, widening downwards by 0.22 of its radius each metre, dived at three levels.

    It has three side chambers about a metre deep, and 14 stops, as the expeditions of 2011 and 2012 tell of such a
    cistern.
    """
    wall = rock_cut(_with_chambers(2.1, ((10.0, 14.0), (128.0, 16.0), (246.0, 13.0))), np.random.default_rng(1302))
    levels: tuple[tuple[float, tuple[tuple[float, float, float], ...]], ...] = (
        (1.3, ((-0.5, -0.4, 0.0), (0.7, -0.3, 70.0), (0.4, 0.8, 10.0), (-0.7, 0.5, 300.0))),
        (2.1, ((-0.9, -0.5, 240.0), (0.3, -0.9, 150.0), (1.1, -0.6, 125.0), (0.9, 0.7, 45.0), (0.3, 1.4, 10.0))),
        (2.8, ((-0.6, 1.1, 320.0), (-1.5, -0.4, 250.0), (-0.3, -1.4, 190.0), (1.4, -0.9, 100.0), (0.2, 0.2, 20.0))),
    )
    stops = tuple(stop(x_m, y_m, deg, depth_m) for depth_m, places in levels for x_m, y_m, deg in places)
    return Site("bell", (wall,), floor_m=3.4, stops=stops, taper_per_m=0.22)


def _with_chambers(radius_m: float, chambers: tuple[tuple[float, float], ...]) -> Outline:
    """Return a circle, clockwise, with chambers a metre deep: each bearing and half the width, in degrees."""
    outline: Outline = []
    for (bearing, half), (after, after_half) in pairwise((*chambers, (chambers[0][0] + 360.0, chambers[0][1]))):
        middle = radians(bearing)
        across = radius_m * sin(radians(half))
        deep = radius_m + 1.0
        for side in (-across, across):
            outline.append((deep * sin(middle) + side * cos(middle), deep * cos(middle) - side * sin(middle)))
        outline += oval((0.0, 0.0), 2 * radius_m, 2 * radius_m, bearing + half, after - after_half)
    return outline
