"""Fields: what a scan, or the map, says of places, for scoring the wall points of other scans there."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt

from mapping.values import FREE, Grid, Returns

HIT_FREE = 0.05
"""Odds of a point in water that was seen free, against 1 at a wall ..."""
HIT_UNKNOWN = 0.3
"""... and of one where nothing is known: neutral."""
WALL_LOG_ODDS = 0.4
"""Cells above this are walls to registration: it may use vague ones too."""
KNOWN_M = 0.3
PAD_M = 0.6
"""Unknown border around a field."""
FINE_RAD = math.radians(0.3)
"""Bearing step in which a scan's water is drawn: 5 cm at 10 m."""
JOIN_M, JOIN_SLOPE = 0.12, 2.5
"""Neighbouring returns are one wall where their ranges differ by no more than this, or than this many arcs."""
JOIN_STEPS, OPEN_STEPS = 2.5, 3.5
"""Beams apart by so many steps may see one wall; the water between them is open up to the nearer return."""
SHORT_SDS = 2.0
"""Water is open up to so many standard deviations before a return."""
VAGUE_SD_M = 0.3
"""Returns of more than this are no walls."""

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Field:
    """Scores of points: ``distance_m`` to the next wall and ``free`` per cell, both ``(rows, cols)``."""

    distance_m: Floats
    free: NDArray[np.bool_]
    cell_m: float
    x0_m: float
    y0_m: float

    def scores(self, sigma_m: float) -> NDArray[np.float32]:
        """Log-likelihood ratio per cell against knowing nothing, ``(rows, cols)``, at a width of the walls."""
        near = np.exp(-0.5 * (self.distance_m / sigma_m) ** 2)
        odds = near + np.where(self.free, HIT_FREE, HIT_UNKNOWN)
        return np.log(odds / HIT_UNKNOWN).astype(np.float32)

    def cells(self, x_m: NDArray[np.floating], y_m: NDArray[np.floating]) -> NDArray[np.int32]:
        """Flat indices of places; beyond the border the border's own, where nothing is known."""
        rows, cols = self.free.shape
        col = np.clip((x_m - self.x0_m) / self.cell_m, 0, cols - 1).astype(np.int32)
        row = np.clip((y_m - self.y0_m) / self.cell_m, 0, rows - 1).astype(np.int32)
        return np.asarray(row * np.int32(cols) + col, dtype=np.int32)

    def known(self) -> NDArray[np.float32]:
        """1 where a point would be judged, in free water or at a wall, else 0, ``(rows, cols)``."""
        return (self.free | (self.distance_m < KNOWN_M)).astype(np.float32)


def field_of(grid: Grid) -> Field:
    """Make the field of a grid, with a border of unknown."""
    pad = math.ceil(PAD_M / grid.cell_m)
    state = np.pad(grid.state, pad)
    wall = np.pad(grid.log_odds, pad) > WALL_LOG_ODDS
    x0_m, y0_m = grid.x0_m - pad * grid.cell_m, grid.y0_m - pad * grid.cell_m
    return Field(_distance_m(wall, grid.cell_m), state == FREE, grid.cell_m, x0_m, y0_m)


def field_of_scan(bearing_rad: Floats, returns: Returns, step_rad: float, cell_m: float) -> Field:
    """Make the field of one scan, in its own axes.

    More is open here than the map's evidence says: between two returns the water is open up to the nearer one.  A beam
    that reaches farther than both of its neighbours opens nothing beyond them: it may have heard a ghost.
    """
    range_m, free_m = outline(bearing_rad, returns, step_rad)
    theta = np.arange(len(range_m)) * (2.0 * math.pi / len(range_m))
    ray = np.stack([np.sin(theta), np.cos(theta)])
    walls = (ray * range_m)[:, np.isfinite(range_m)]
    ends = np.concatenate([walls, ray * free_m, np.zeros((2, 1))], axis=1)
    (x0_m, y0_m), far = (np.floor((ends.min(axis=1) - PAD_M) / cell_m) * cell_m).tolist(), ends.max(axis=1) + PAD_M
    cols, rows = math.ceil((far[0] - x0_m) / cell_m), math.ceil((far[1] - y0_m) / cell_m)
    wall = np.zeros((rows, cols), dtype=bool)
    wall[((walls[1] - y0_m) / cell_m).astype(np.intp), ((walls[0] - x0_m) / cell_m).astype(np.intp)] = True
    x = ((np.arange(cols) + 0.5) * cell_m + x0_m).astype(np.float32)
    y = ((np.arange(rows) + 0.5) * cell_m + y0_m).astype(np.float32)[:, None]
    turns = np.arctan2(x, y) * np.float32(len(theta) / (2.0 * math.pi)) + np.float32(len(theta) + 0.5)
    free = np.sqrt(x * x + y * y) < free_m.astype(np.float32)[turns.astype(np.int32) % len(theta)]
    return Field(_distance_m(wall, cell_m), free & ~wall, cell_m, x0_m, y0_m)


def _distance_m(wall: NDArray[np.bool_], cell_m: float) -> Floats:
    if not wall.any():
        return np.full(wall.shape, 1e3)
    return np.asarray(distance_transform_edt(~wall), dtype=np.float64) * cell_m


def outline(bearing_rad: Floats, returns: Returns, step_rad: float) -> tuple[Floats, Floats]:
    """Range of the wall, nan where there is none, and how far the water is open, ``(n,)`` each in fine bearings."""
    fine = np.arange(round(2.0 * math.pi / FINE_RAD)) * FINE_RAD
    bearing, z, sd, free = _told(bearing_rad, returns)
    if not len(bearing):
        return np.full(len(fine), np.nan), np.zeros(len(fine))
    right = np.searchsorted(bearing, fine) % len(bearing)
    left = right - 1
    gap = (bearing[right] - bearing[left]) % (2.0 * math.pi)
    share = ((fine - bearing[left]) % (2.0 * math.pi)) / np.maximum(gap, 1e-9)
    nearest = np.where(share < 0.5, left, right)
    beside = np.minimum(share, 1.0 - share) * gap <= 0.55 * step_rad
    alike_m = np.maximum(JOIN_M, JOIN_SLOPE * gap * np.fmin(z[left], z[right]))
    joined = (np.abs(z[right] - z[left]) <= alike_m) & (gap < JOIN_STEPS * step_rad)
    straight = 1.0 / ((1.0 - share) / z[left] + share / z[right])  # a straight wall is linear in 1 / range
    range_m = np.where(joined, straight, np.where(beside, z[nearest], np.nan))
    sd_m = np.where(joined, np.fmax(sd[left], sd[right]), sd[nearest])
    open_m = np.where(joined, np.fmin(straight - SHORT_SDS * sd_m, np.maximum(free[left], free[right])), 0.0)
    open_m = np.where(joined, open_m, np.minimum(free[left], free[right]))
    open_m = np.where(gap < OPEN_STEPS * step_rad, open_m, np.where(beside, free[nearest], 0.0))
    return np.where(sd_m < VAGUE_SD_M, range_m, np.nan), np.maximum(open_m, 0.0)


def _told(bearing_rad: Floats, returns: Returns) -> tuple[Floats, Floats, Floats, Floats]:
    """Bearing, range, sd and free range of the beams that say something, by bearing."""
    order = np.argsort(bearing_rad % (2.0 * math.pi), kind="stable")
    order = order[np.isfinite(returns.range_m[order]) | (returns.free_m[order] > 0.0)]
    z, sd, free = returns.range_m[order], returns.sd_m[order], returns.free_m[order]
    free = np.fmin(free, z - SHORT_SDS * sd)
    free = np.minimum(free, np.maximum(np.roll(free, 1), np.roll(free, -1)))
    return bearing_rad[order] % (2.0 * math.pi), z, sd, free
