"""Natural rock: no straight wall, no right angle."""

from __future__ import annotations

from math import cos, sin, tau

import numpy as np

from tools.emulator.site.shapes import Outline, oval, rock_cut, stop
from tools.emulator.site.values import Site

_LOBES = ((2, 0.16, 0.6), (3, 0.14, 2.1), (5, 0.09, 4.0), (8, 0.05, 1.2))
"""Waves around the outline: how many to the turn, share of the radius, phase."""


def cave() -> Site:
    """Return an irregular cave with overhanging walls and two boulders, 2.5 m of water.

    In size Site 8 of the paper's table 1 (160 x 120 cells, 25 of height).
    """
    rng = np.random.default_rng(88)
    wall = rock_cut(_lobed(4.9, 3.7), rng, facet_m=0.28, roughness_m=0.09)
    boulders = [
        rock_cut(oval((1.5, 0.6), 0.9, 0.7), rng, facet_m=0.15, roughness_m=0.04),
        rock_cut(oval((-2.4, -1.4), 0.6, 0.8), rng, facet_m=0.15, roughness_m=0.04),
    ]
    stops = (
        stop(-0.4, -0.9, 30.0),
        stop(-1.4, -2.4, 230.0, depth_m=1.2),
        stop(-3.6, -2.2, 300.0, depth_m=1.2),
        stop(-3.6, -0.6, 20.0, depth_m=1.3),
        stop(-1.6, 0.3, 60.0, depth_m=1.3),
        stop(-0.6, 2.2, 20.0, depth_m=1.4),
        stop(1.2, 2.3, 85.0, depth_m=1.4),
        stop(3.0, 1.4, 120.0, depth_m=1.5),
        stop(2.8, -0.8, 170.0, depth_m=1.5),
        stop(1.2, -2.0, 240.0, depth_m=1.4),
        stop(-0.2, -0.6, 310.0),
    )
    return Site("cave", (wall, *boulders), floor_m=2.5, stops=stops, taper_per_m=0.05)


def _lobed(half_width_m: float, half_height_m: float) -> Outline:
    outline: Outline = []
    for angle in np.arange(0.0, tau - 1e-9, tau / 90.0):
        scale = 1.0 + sum(share * sin(count * float(angle) + phase) for count, share, phase in _LOBES)
        outline.append((half_width_m * scale * sin(angle), half_height_m * scale * cos(angle)))
    return outline
