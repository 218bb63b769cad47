"""Values of the filling stages: hole, filled grid, mesh."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from mapping.values import Grid

MEASURED: Final = 0
FILLED: Final = 1
ASSUMED: Final = 2
"""Kinds of a mesh vertex: wall seen by the sonar, wall filled in, floor assumed at the known depth."""


@dataclass(frozen=True, slots=True)
class Hole:
    """A gap between two wall ends that was filled.

    ``cells`` is ``(n, 2)`` int32 of row and column in the grid (row 0 south), connected, none of them measured as
    occupied or free; ``certainty`` ``(n,)`` float32 in 0 to 1 per cell; ``hole_certainty`` that the whole fill is
    right.  ``ends_m`` is ``(2, 2)`` float64, x and y of the two ends.  ``why`` is one sentence for a person.
    ``parents`` are the indices of earlier holes whose fills this one goes on from: it is never surer than they are.
    ``beyond_learnt``: the hole is unlike any that certainties were learnt on, and told the less sure for it.
    """

    index: int
    cells: NDArray[np.int32]
    certainty: NDArray[np.float32]
    hole_certainty: float
    ends_m: NDArray[np.float64]
    gap_m: float
    curve: str
    why: str
    parents: tuple[int, ...] = ()
    beyond_learnt: bool = False


@dataclass(frozen=True, slots=True)
class Filled:
    """The evidence grid, untouched, with the holes filled in a layer of their own.

    ``certainty`` ``(rows, cols)`` float32, 0 where nothing is filled; ``hole`` ``(rows, cols)`` int32, the hole's
    index or -1. ``open_ends_m`` is ``(n, 2)`` float64, x and y of wall ends that were left open; ``noise_ends`` is how
    many ends were not looked at, since no site has so many: what they belong to is noise.
    """

    grid: Grid
    holes: tuple[Hole, ...]
    certainty: NDArray[np.float32]
    hole: NDArray[np.int32]
    open_ends_m: NDArray[np.float64]
    noise_ends: int = 0


@dataclass(frozen=True, slots=True)
class Mesh:
    """Triangles of walls and floor.

    ``vertices`` ``(n, 3)`` float32, m in the map frame (x east, y north, z down from the water surface); ``triangles``
    ``(m, 3)`` uint32; ``kind`` ``(n,)`` uint8 of MEASURED, FILLED, ASSUMED; ``certainty`` ``(n,)`` float32 in 0 to 1,
    1 where measured.
    """

    vertices: NDArray[np.float32]
    triangles: NDArray[np.uint32]
    kind: NDArray[np.uint8]
    certainty: NDArray[np.float32]
