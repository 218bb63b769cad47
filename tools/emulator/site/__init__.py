"""Emulated sites.

Frame: x east, y north, z down from the water surface; headings clockwise from north.  In the plan, water lies inside
the first wall and outside the others.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from tools.emulator.site.caves import cave
from tools.emulator.site.cisterns import bell, house, keyhole
from tools.emulator.site.halls import hall, pool
from tools.emulator.site.passages import gallery, loop, tunnel
from tools.emulator.site.shapes import rectangle
from tools.emulator.site.values import PLASTER, ROCK, TILE, Material, Site, Stop, Wall

SITES: Final[dict[str, Callable[[], Site]]] = {
    "bell": bell,
    "cave": cave,
    "gallery": gallery,
    "hall": hall,
    "house": house,
    "keyhole": keyhole,
    "loop": loop,
    "pool": pool,
    "tunnel": tunnel,
}
"""Every site that can be emulated, by name."""

__all__ = ["PLASTER", "ROCK", "SITES", "TILE", "Material", "Site", "Stop", "Wall", "rectangle"]
