"""How sure is the map, when the places of its stations are not?  The evidence, drawn at many places that they may have.

Poses are drawn jointly from what the graph knows, so that stations which hold each other move together.  Within a draw
evidence adds up as log-odds; over the draws probabilities are averaged, for a cell is occupied in some of them and not
in others.  The map's geometry stays that of the best poses: an average of maps that lie beside each other has thin
walls washed out, and holes that are none.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mapping.grid import Cells, added
from mapping.values import OCCUPIED, Grid, Pose

DRAWS = 24
"""Half of them mirror the others, so that their mean is the best map's place."""

Floats = NDArray[np.float64]
Placed = tuple[Pose, Cells]


@dataclass(frozen=True, slots=True)
class Mixture:
    """Layers beside a grid, ``(rows, cols)`` float32 each, relative to the first station.

    ``probability`` is the occupancy, mixed over the poses; ``sd_m`` the standard deviation, to either side, of where a
    wall lies, 0 where there is none.
    """

    probability: NDArray[np.float32]
    sd_m: NDArray[np.float32]


def draw(covariance: Floats, rng: np.random.Generator) -> Floats:
    """Draw deviations of n poses, ``(DRAWS, n, 3)``, from their joint covariance ``(3 n, 3 n)``."""
    value, vector = np.linalg.eigh(0.5 * (covariance + covariance.T))
    half = rng.normal(0.0, 1.0, (DRAWS // 2, len(value))) * np.sqrt(np.maximum(value, 0.0)) @ vector.T
    return np.concatenate([half, -half]).reshape(DRAWS, -1, 3)


def mix(grid: Grid, placed: Sequence[Placed], off: Floats) -> Mixture:
    """Mix the evidence of stations over deviations ``(draws, n, 3)`` of their poses, cell by cell of their grid."""
    if not grid.state.size:
        return Mixture(np.zeros(grid.state.shape, np.float32), np.zeros(grid.state.shape, np.float32))
    probability = np.zeros(grid.state.shape)
    for each in off:
        moved = [_moved(pose, cells, by, grid) for (pose, cells), by in zip(placed, each, strict=True)]
        probability += 1.0 / (1.0 + np.exp(-added(moved, grid.state.shape, _corner(grid), grid.cell_m)))
    return Mixture((probability / len(off)).astype(np.float32), _wall_sd_m(grid, placed, off))


def _corner(grid: Grid) -> tuple[int, int]:
    """Row and column of the grid's own first cell, from the map's origin."""
    return round(grid.y0_m / grid.cell_m), round(grid.x0_m / grid.cell_m)


def _moved(pose: Pose, cells: Cells, by: Floats, grid: Grid) -> Cells:
    """Bring what a scan says to where it would be seen from a pose close by; what leaves the grid is left out."""
    dx, dy = _from(pose, cells, grid.cell_m)
    col = np.floor((pose.x_m + by[0] + dx + dy * by[2]) / grid.cell_m).astype(np.int32)
    row = np.floor((pose.y_m + by[1] + dy - dx * by[2]) / grid.cell_m).astype(np.int32)
    south, west = _corner(grid)
    rows, cols = grid.state.shape
    inside = (row >= south) & (row < south + rows) & (col >= west) & (col < west + cols)
    return Cells(row[inside], col[inside], cells.log_odds[inside])


def _from(pose: Pose, cells: Cells, cell_m: float) -> tuple[Floats, Floats]:
    """Places of cells from a pose, east and north."""
    col, row = cells.col.astype(np.float64), cells.row.astype(np.float64)
    return (col + 0.5) * cell_m - pose.x_m, (row + 0.5) * cell_m - pose.y_m


def _wall_sd_m(grid: Grid, placed: Sequence[Placed], off: Floats) -> NDArray[np.float32]:
    """Tell how far each wall may be off: the mean of the scans that show it moves with their poses."""
    walls = np.flatnonzero(grid.state.ravel() == OCCUPIED)
    number = np.full(grid.state.size, -1)
    number[walls] = np.arange(len(walls))
    shift, shown = np.zeros((2, len(off), len(walls))), np.zeros(len(walls))
    for k, (pose, cells) in enumerate(placed):
        here = _moved(pose, cells, np.zeros(3), grid)
        wall = number[(here.row - _corner(grid)[0]) * grid.state.shape[1] + here.col - _corner(grid)[1]]
        told = (here.log_odds > 0.0) & (wall >= 0)
        (dx, dy), at, weight = _from(pose, here, grid.cell_m), wall[told], here.log_odds[told]
        shown[at] += weight
        shift[0][:, at] += weight * (off[:, k, :1] + np.outer(off[:, k, 2], dy[told]))
        shift[1][:, at] += weight * (off[:, k, 1:2] - np.outer(off[:, k, 2], dx[told]))
    sd_m = np.zeros(grid.state.size, np.float32)
    sd_m[walls] = np.sqrt((shift**2).sum(axis=0).mean(axis=0) / 2.0) / np.maximum(shown, 1e-9)
    return sd_m.reshape(grid.state.shape)
