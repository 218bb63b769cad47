"""The evidence grid: scans at their poses, gathered cell by cell."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from config.schema import Map
from mapping.beam import HINT_LOG_ODDS, PolarEvidence
from mapping.values import FREE, OCCUPIED, UNKNOWN, Grid, Pose

CLAMP_OCCUPIED = 4.6
CLAMP_FREE = -3.5
"""Log-odds are held within these, so that a mistake can be unlearnt."""
MARGIN_CELLS = 2

Placed = tuple[Pose, PolarEvidence]


def empty(config: Map) -> Grid:
    """Give a grid of no cells."""
    return Grid(config.cell_m, 0.0, 0.0, np.zeros((0, 0), np.float32), np.zeros((0, 0), np.uint8))


def render(placed: Sequence[Placed], config: Map) -> Grid:
    """Draw scans at their poses into a grid as large as they need, its edges on multiples of the cell."""
    if not placed:
        return empty(config)
    cell = config.cell_m
    reach = [evidence.log_odds.shape[1] * evidence.range_step_m for _, evidence in placed]
    west = math.floor(min(p.x_m - r for (p, _), r in zip(placed, reach, strict=True)) / cell)
    east = math.ceil(max(p.x_m + r for (p, _), r in zip(placed, reach, strict=True)) / cell)
    south = math.floor(min(p.y_m - r for (p, _), r in zip(placed, reach, strict=True)) / cell)
    north = math.ceil(max(p.y_m + r for (p, _), r in zip(placed, reach, strict=True)) / cell)
    total = np.zeros((north - south, east - west), dtype=np.float64)
    hints = np.zeros_like(total)
    for pose, evidence in placed:
        add(total, hints, pose, evidence, cell, (south, west))
    total = np.where(total >= 0.0, np.maximum(total, hints), total)
    return trim(np.clip(total, CLAMP_FREE, CLAMP_OCCUPIED).astype(np.float32), (south, west), config)


def add(
    total: NDArray[np.float64],
    hints: NDArray[np.float64],
    pose: Pose,
    evidence: PolarEvidence,
    cell_m: float,
    corner: tuple[int, int],
) -> None:
    """Add one scan to a grid of log-odds in place: each cell looks up its own bearing and range."""
    table = evidence.log_odds
    reach = table.shape[1] * evidence.range_step_m
    south, west = corner
    rows = slice(*_span(pose.y_m, reach, cell_m, south, total.shape[0]))
    cols = slice(*_span(pose.x_m, reach, cell_m, west, total.shape[1]))
    y = ((np.arange(rows.start, rows.stop) + south + 0.5) * cell_m - pose.y_m)[:, None]
    x = ((np.arange(cols.start, cols.stop) + west + 0.5) * cell_m - pose.x_m)[None, :]
    turn = np.arctan2(x, y) - pose.heading_rad
    bearing = np.floor(turn * (table.shape[0] / (2.0 * math.pi)) + 0.5).astype(np.intp) % table.shape[0]
    reached = (np.sqrt(x * x + y * y) / evidence.range_step_m).astype(np.intp)
    within = reached < table.shape[1]
    told = np.where(within, table[bearing, np.minimum(reached, table.shape[1] - 1)], 0.0)
    hint = (told > 0.0) & (told <= HINT_LOG_ODDS)
    total[rows, cols] += np.where(hint, 0.0, told)
    np.maximum(hints[rows, cols], np.where(hint, told, 0.0), out=hints[rows, cols])


def _span(centre_m: float, reach_m: float, cell_m: float, first: int, size: int) -> tuple[int, int]:
    low = math.floor((centre_m - reach_m) / cell_m) - first
    high = math.ceil((centre_m + reach_m) / cell_m) - first
    return max(low, 0), min(high, size)


def trim(log_odds: NDArray[np.float32], corner: tuple[int, int], config: Map) -> Grid:
    """Cut a grid to what it knows, and tell the state of each cell."""
    known = log_odds != 0.0
    if not known.any():
        return empty(config)
    rows = np.flatnonzero(known.any(axis=1))
    cols = np.flatnonzero(known.any(axis=0))
    south, north = max(rows[0] - MARGIN_CELLS, 0), rows[-1] + 1 + MARGIN_CELLS
    west, east = max(cols[0] - MARGIN_CELLS, 0), cols[-1] + 1 + MARGIN_CELLS
    kept = np.ascontiguousarray(log_odds[south:north, west:east])
    x0_m, y0_m = (corner[1] + int(west)) * config.cell_m, (corner[0] + int(south)) * config.cell_m
    return Grid(config.cell_m, x0_m, y0_m, kept, states(kept, config))


def states(log_odds: NDArray[np.float32], config: Map) -> NDArray[np.uint8]:
    """Tell unknown, free and occupied apart at the configured probabilities."""
    occupied, free = config.occupied_threshold, config.free_threshold
    state = np.full(log_odds.shape, UNKNOWN, dtype=np.uint8)
    state[(log_odds < 0.0) & (log_odds <= math.log(free / (1.0 - free)))] = FREE
    state[(log_odds > 0.0) & (log_odds >= math.log(occupied / (1.0 - occupied)))] = OCCUPIED
    return state
