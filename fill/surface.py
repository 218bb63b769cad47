"""The surface: walls extruded from the ceiling or the water's surface to the floor, and a floor under the water seen.

A sonar that scans one plane says nothing about the vertical: that walls are plumb and the floor is level is an
assumption, and the floor carries it as its kind.  All layers of an extruded wall are equal, so that smoothing is done
once, in 2D, and few layers need to be contoured (marching cubes, Lewiner et al. 2003).
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from skimage.measure import marching_cubes

from fill.values import ASSUMED, FILLED, MEASURED, Filled, Mesh
from mapping.values import FREE, OCCUPIED

_SMOOTHING: Final = 0.6  # cells
_KEPT: Final = 0.6  # level of a wall cell that smoothing alone would remove; the surface is at 0.5
_LAYERS: Final = 2  # layers of wall above the floor
_FLOOR_CERTAINTY: Final = 0.5


def extrude(filled: Filled, top_m: float, floor_m: float) -> Mesh:
    """Make the closed surface of walls between depths ``top_m`` and ``floor_m`` (z down) and of the floor below.

    The floor is one cell thick and lies below ``floor_m``.  Triangles run counter-clockwise seen from outside, with z
    drawn downwards.  A grid without walls and without water, or a floor not below the top, gives an empty mesh.
    """
    wall = (filled.grid.state == OCCUPIED) | (filled.hole >= 0)
    floor = wall | interior(filled)
    if not floor.any() or floor_m <= top_m:
        return empty_mesh()
    origin, window = _window(floor)
    volume = _volume(wall[window], floor[window])
    found, triangles, _, _ = marching_cubes(volume, 0.5, gradient_direction="ascent")  # type: ignore[no-untyped-call]
    corners = np.asarray(found, np.float64)
    kind, certainty = _classes(corners, filled, wall, origin)
    return Mesh(
        _places(corners, filled, origin, top_m, floor_m),
        np.ascontiguousarray(triangles, np.uint32),
        kind,
        certainty,
    )


def empty_mesh() -> Mesh:
    """Return a mesh without a vertex."""
    return Mesh(
        np.zeros((0, 3), np.float32), np.zeros((0, 3), np.uint32), np.zeros(0, np.uint8), np.zeros(0, np.float32)
    )


def interior(filled: Filled) -> NDArray[np.bool_]:
    """Cells ``(rows, cols)`` of water: those seen free, and unseen ones that walls and fills close in with them."""
    free = filled.grid.state == FREE
    wall = (filled.grid.state == OCCUPIED) | (filled.hole >= 0)
    rooms, count = ndimage.label(~wall)
    holds_water = np.zeros(count + 1, bool)
    holds_water[np.unique(rooms[free])] = True
    # A room that reaches the grid's edge has leaked: of it only what was seen is floor.
    border = np.concatenate([rooms[:1].ravel(), rooms[-1:].ravel(), rooms[:, :1].ravel(), rooms[:, -1:].ravel()])
    holds_water[np.unique(border)] = False
    holds_water[0] = False
    return np.asarray(holds_water[rooms] | free, np.bool_)


def _window(floor: NDArray[np.bool_]) -> tuple[NDArray[np.int64], tuple[slice, slice]]:
    """First cell, and slices, of the part of the grid in which something stands."""
    cells = np.argwhere(floor)
    low, high = cells.min(axis=0), cells.max(axis=0) + 1
    return low, (slice(low[0], high[0]), slice(low[1], high[1]))


def _volume(wall: NDArray[np.bool_], floor: NDArray[np.bool_]) -> NDArray[np.float32]:
    """Layers from the top down, each padded by two empty cells: air, walls, floor, ground."""
    blank = np.zeros((wall.shape[0] + 4, wall.shape[1] + 4), np.float32)
    standing = _smoothed(np.pad(wall, 2))
    lying = np.maximum(_smoothed(np.pad(floor, 2)), standing)
    return np.stack([blank, *[standing] * _LAYERS, lying, blank])


def _smoothed(mask: NDArray[np.bool_]) -> NDArray[np.float32]:
    solid = mask.astype(np.float32)
    return np.asarray(np.maximum(ndimage.gaussian_filter(solid, _SMOOTHING), _KEPT * solid), np.float32)


def _places(
    corners: NDArray[np.float64], filled: Filled, origin: NDArray[np.int64], top_m: float, floor_m: float
) -> NDArray[np.float32]:
    grid = filled.grid
    bottom_m = floor_m + grid.cell_m
    # Between two layers the surface is level: where exactly smoothing let it cross says nothing.
    layer = np.where(corners[:, 0] % 1.0 > 0, np.floor(corners[:, 0]) + 0.5, corners[:, 0])
    depth = np.interp(layer, [0.5, _LAYERS + 0.5, _LAYERS + 1.5], [top_m, floor_m, bottom_m])
    north = grid.y0_m + (corners[:, 1] - 2 + origin[0] + 0.5) * grid.cell_m
    east = grid.x0_m + (corners[:, 2] - 2 + origin[1] + 0.5) * grid.cell_m
    return np.stack([east, north, depth], axis=1).astype(np.float32)


def _classes(
    corners: NDArray[np.float64], filled: Filled, wall: NDArray[np.bool_], origin: NDArray[np.int64]
) -> tuple[NDArray[np.uint8], NDArray[np.float32]]:
    """Kind and certainty of each vertex, from the nearest cell as it was before smoothing."""
    place = np.rint(corners[:, 1:]).astype(np.int64) - 2 + origin
    row, col = np.clip(place, 0, np.array(wall.shape) - 1).T
    kind = np.full(len(corners), ASSUMED, np.uint8)
    certainty = np.full(len(corners), _FLOOR_CERTAINTY, np.float32)
    if not wall.any():
        return kind, certainty
    away, nearest = ndimage.distance_transform_edt(~wall, return_indices=True)
    upright = (corners[:, 0] < _LAYERS + 0.5) | (away[row, col] == 0)
    near_row, near_col = nearest[0][row, col][upright], nearest[1][row, col][upright]
    guessed = filled.hole[near_row, near_col] >= 0
    kind[upright] = np.where(guessed, FILLED, MEASURED)
    certainty[upright] = np.where(guessed, filled.certainty[near_row, near_col], 1.0)
    return kind, certainty
