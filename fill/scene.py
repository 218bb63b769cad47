"""What ways to close holes are drawn in: walls, what was seen, and how far every cell is from water seen free."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from fill.segments import End, Walls
from mapping.values import FREE

FARTHEST: Final = 24.0
"""Cells: water further away than this tells nothing about a wall."""
SPECK: Final = 14
"""So many cells of wall are still a speck, and may lie inside a hole."""


@dataclass(frozen=True, slots=True)
class Scene:
    """A grid with its walls.

    ``state`` ``(rows, cols)`` uint8; ``water`` ``(rows, cols)`` float64 is the distance to the nearest cell seen free,
    in cells and no more than ``FARTHEST``; ``speck`` ``(labels,)`` bool tells for each label of ``walls`` whether it is
    a speck (label 0, no wall, counts as one).
    """

    walls: Walls
    state: NDArray[np.uint8]
    water: NDArray[np.float64]
    speck: NDArray[np.bool_]

    @property
    def ends(self) -> tuple[End, ...]:
        """Ends of the walls."""
        return self.walls.ends


def look(walls: Walls, state: NDArray[np.uint8], water: NDArray[np.float64]) -> Scene:
    """Prepare a grid for drawing candidates; ``water`` is as ``from_water`` tells it."""
    size = np.bincount(walls.label.ravel()) if walls.label.size else np.zeros(1, np.int64)
    speck = size <= SPECK
    speck[0] = True
    return Scene(walls, state, water, speck)


def from_water(state: NDArray[np.uint8]) -> NDArray[np.float64]:
    """Distance ``(rows, cols)`` of every cell to the nearest seen free, in cells, no more than ``FARTHEST``."""
    free = state == FREE
    if not free.any():
        return np.full(state.shape, FARTHEST)
    return np.asarray(np.minimum(ndimage.distance_transform_edt(~free), FARTHEST), np.float64)
