"""Where a scan says anything: the squares of cells that its beams reach, so that no others need be looked at."""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d

from mapping.beam import PolarEvidence
from mapping.values import Pose

TILE: Final = 16
"""Cells along the side of a tile."""
SECTORS: Final = 72
"""The circle is divided into so many sectors to tell how far a scan reaches, and in which direction."""

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


def tiles_of(pose: Pose, evidence: PolarEvidence, reaches_m: Floats, cell_m: float) -> tuple[Ints, Ints]:
    """Give the first row and the first column ``(n,)`` of all tiles in which a scan at a pose may say something."""
    reach_m = evidence.log_odds.shape[1] * evidence.range_step_m
    south, west = math.floor((pose.y_m - reach_m) / cell_m), math.floor((pose.x_m - reach_m) / cell_m)
    rows = np.arange(south, math.ceil((pose.y_m + reach_m) / cell_m), TILE)
    cols = np.arange(west, math.ceil((pose.x_m + reach_m) / cell_m), TILE)
    y = ((rows + 0.5 * TILE) * cell_m - pose.y_m)[:, None]
    x = ((cols + 0.5 * TILE) * cell_m - pose.x_m)[None, :]
    half_m = (0.5 * TILE + 1.0) * cell_m * math.sqrt(2.0)  # and a cell more than the farthest from the middle
    away_m = np.hypot(x, y)
    wide_rad = np.where(away_m > half_m, np.arcsin(np.minimum(half_m / np.maximum(away_m, half_m), 1.0)), math.pi)
    sector = np.floor((np.arctan2(x, y) - pose.heading_rad) * (SECTORS / math.tau)).astype(np.int64) % SECTORS
    aside = np.minimum(np.ceil(wide_rad * (SECTORS / math.tau)).astype(np.int64) + 1, SECTORS // 2)
    row, col = np.nonzero(away_m - half_m < reaches_m[aside, sector])
    return rows[row], cols[col]


def reaches_of(evidence: PolarEvidence) -> Floats:
    """Tell how far a scan says anything within so many sectors aside of each, ``(SECTORS / 2 + 1, SECTORS)``."""
    fine, ranges = evidence.log_odds.shape
    told = evidence.log_odds != 0.0
    last = np.where(told.any(axis=1), ranges - told[:, ::-1].argmax(axis=1), 0) * evidence.range_step_m
    # A fine bearing lies about its number, half of it in the sector before where it is a sector's first.
    most = np.zeros(SECTORS)
    np.maximum.at(most, np.arange(fine) * SECTORS // fine, last)
    widths = [maximum_filter1d(most, 2 * aside + 1, mode="wrap") for aside in range(SECTORS // 2 + 1)]
    return np.array(widths)
