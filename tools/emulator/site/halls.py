"""Halls and basins: straight walls and right angles."""

from __future__ import annotations

import numpy as np

from tools.emulator.site.shapes import rectangle, rock_cut, stop
from tools.emulator.site.values import TILE, Site, Wall


def hall() -> Site:
    """Return a rectangular hall with three pillars, a side chamber to the north and another to the east.

    In size and character College Garden of the paper's table 1 (100 x 320 cells, 30 of height): several chambers and
    three pillars.  Hewn walls, 3.2 m of water.
    """
    rng = np.random.default_rng(7)
    outline = [(-10.0, -2.6), (-10.0, 2.6), (-1.6, 2.6), (-1.6, 3.2), (-2.7, 3.2), (-2.7, 5.5), (0.7, 5.5), (0.7, 3.2)]
    outline += [(-0.4, 3.2), (-0.4, 2.6), (5.0, 2.6), (5.0, 0.6), (5.7, 0.6), (5.7, 1.9), (9.8, 1.9), (9.8, -1.8)]
    outline += [(5.7, -1.8), (5.7, -0.6), (5.0, -0.6), (5.0, -2.6)]
    pillars = [rock_cut(rectangle(x - 0.35, -0.35, x + 0.35, 0.35), rng, roughness_m=0.015) for x in (-6.6, -2.5, 1.7)]
    stops = (
        stop(-8.8, -1.0, 0.0),
        stop(-6.6, -1.5, 95.0),
        stop(-4.5, -1.2, 80.0),
        stop(-2.5, -1.5, 90.0),
        stop(-0.4, -1.2, 60.0),
        stop(1.7, -1.5, 95.0),
        stop(3.5, -0.8, 70.0),
        stop(4.2, 0.0, 90.0),
        stop(6.8, 0.1, 85.0, depth_m=1.5),
        stop(8.5, -0.4, 120.0, depth_m=1.6),
        stop(6.7, 0.0, 270.0, depth_m=1.5),
        stop(4.1, 0.3, 280.0, via=((5.3, 0.0),)),
        stop(2.4, 1.4, 290.0),
        stop(0.5, 1.2, 275.0),
        stop(-1.0, 1.6, 355.0),
        stop(-1.0, 4.2, 10.0, depth_m=1.5),
        stop(-1.0, 1.7, 180.0),
        stop(-3.4, 1.3, 265.0),
        stop(-5.4, 1.4, 280.0),
        stop(-7.6, 1.3, 250.0),
        stop(-8.7, -0.4, 190.0),
    )
    return Site("hall", (rock_cut(outline, rng, roughness_m=0.025), *pillars), floor_m=3.2, stops=stops)


def pool() -> Site:
    """Return a tiled swimming pool of known size, 8 x 5 m, 2 m deep."""
    stops = (stop(-2.2, 0.4, 10.0), stop(-0.6, -0.7, 60.0), stop(1.2, 0.5, 95.0), stop(2.5, -0.6, 140.0))
    return Site("pool", (Wall(np.array(rectangle(-4, -2.5, 4, 2.5))),), floor_m=2.0, stops=stops, material=TILE)
