"""Emulated sites as maps to knock holes into: cisterns, galleries and caves; the real maps are all of buildings."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from skimage.draw import polygon

from mapping.values import FREE, OCCUPIED, UNKNOWN
from tools.emulator.site import SITES, Site

_CELLS_M: Final = (0.05, 0.1)
_THICK: Final = (1, 2, 3)  # cells
_ROUGH_M: Final = (0.0, 0.03)
_MARGIN: Final = 6


def drawn_sites(random: np.random.Generator) -> Iterator[tuple[str, NDArray[np.uint8]]]:
    """Yield every emulated site by name, as a finished map, turned at random, of random cell and wall thickness."""
    for name, build in SITES.items():
        yield (
            name,
            draw_site(
                build(),
                float(random.choice(_CELLS_M)),
                float(random.uniform(0.0, math.tau)),
                int(random.choice(_THICK)),
                random,
            ),
        )


def draw_site(site: Site, cell_m: float, turn_rad: float, thick: int, random: np.random.Generator) -> NDArray[np.uint8]:
    """Draw the plan of a site, turned by ``turn_rad``: water, walls ``thick`` cells deep and a little rough, rock."""
    cosine, sine = math.cos(turn_rad), math.sin(turn_rad)
    turn = np.array([[cosine, -sine], [sine, cosine]])
    walls = [wall.points_m @ turn.T / cell_m for wall in site.walls]
    low = np.min([wall.min(axis=0) for wall in walls], axis=0) - _MARGIN - thick
    high = np.max([wall.max(axis=0) for wall in walls], axis=0) + _MARGIN + thick
    shape = tuple(np.ceil(high - low).astype(int)[::-1])
    water = np.zeros(shape, bool)
    for number, wall in enumerate(walls):
        x, y = (wall - low).T
        rows, cols = polygon(y, x, shape)  # type: ignore[no-untyped-call]
        water[rows, cols] = number == 0
    rough = ndimage.gaussian_filter(random.normal(size=shape), 1.5) * 3.0 * float(random.choice(_ROUGH_M)) / cell_m
    inward = ndimage.distance_transform_edt(water)
    behind = ndimage.distance_transform_edt(~water)
    signed = np.where(water, -inward + 0.5, behind - 0.5) + rough
    state = np.full(shape, UNKNOWN, np.uint8)
    state[signed <= 0.0] = FREE
    state[(signed > 0.0) & (signed <= thick)] = OCCUPIED
    return state
