"""What lies behind a wall is hidden: rays of one scan that pass a wall which the whole map shows tell nothing there.

By way of a bounce, and by its side lobes, a sonar hears walls where none are: behind a wall that the beam met at a
slant and that answered faintly.  Alone a scan cannot tell this from an opening; scans from elsewhere saw the wall.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d, minimum_filter1d

from mapping.grid import Cells
from mapping.values import OCCUPIED, Grid, Pose

FIRM: Final = 2.0
"""Log-odds of a wall, after all that was seen through it, from which it hides what is behind."""
BEHIND_M: Final = 0.3
"""A ray that goes on behind a wall by less may have met it: poses and walls are known to centimetres."""
RAYS: Final = 600
"""All directions about a scan; a ray is a fifth of a beam ..."""
RAY_RAD: Final = 2.0 * math.pi / RAYS
WIDEST: Final = 8
"""A wall so near that one cell hides more rays on either side is not asked for them."""
BETWEEN: Final = 5
"""... and what lies between two rays that a wall ends, no farther apart, is hidden too, and the ray beside them."""

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]


def seen_by(poses: Sequence[Pose], scans: Sequence[Cells], grid: Grid) -> list[Cells]:
    """Give what scans say at their poses, less what the walls of ``grid``, which they make, hide from them."""
    wall = (grid.state == OCCUPIED) & (grid.log_odds >= FIRM)
    south, west = round(grid.y0_m / grid.cell_m), round(grid.x0_m / grid.cell_m)
    told = []
    for pose, cells in zip(poses, scans, strict=True):
        open_water = cells.log_odds < 0.0
        row = np.clip(cells.row - south, 0, wall.shape[0] - 1)
        passed = open_water & wall[row, np.clip(cells.col - west, 0, wall.shape[1] - 1)]
        told.append(_up_to(passed, open_water, pose, cells, grid.cell_m) if passed.any() else cells)
    return told


def _up_to(passed: Flags, open_water: Flags, pose: Pose, cells: Cells, cell_m: float) -> Cells:
    """Leave out what lies behind the walls that were passed, in rays that go on far behind them."""
    x, y = (cells.col + 0.5) * cell_m - pose.x_m, (cells.row + 0.5) * cell_m - pose.y_m
    range_m, ray = np.hypot(x, y), np.rint(np.arctan2(x, y) / RAY_RAD).astype(np.intp) % RAYS
    end_m, free_m = np.full(RAYS, np.inf), np.zeros(RAYS)
    wide = np.minimum(0.5 * cell_m / range_m[passed] / RAY_RAD, WIDEST).astype(np.intp)  # near cells fill several rays
    for aside in range(-WIDEST, WIDEST + 1):
        met = np.flatnonzero(passed)[wide >= abs(aside)]
        np.minimum.at(end_m, (ray[met] + aside) % RAYS, range_m[met])
    np.maximum.at(free_m, ray[open_water], range_m[open_water])
    end_m[free_m < end_m + BEHIND_M] = np.inf
    end_m = maximum_filter1d(minimum_filter1d(end_m, BETWEEN + 2, mode="wrap"), BETWEEN, mode="wrap")
    kept = range_m < end_m[ray]
    return Cells(cells.row[kept], cells.col[kept], cells.log_odds[kept])
