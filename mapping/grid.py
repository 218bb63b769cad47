"""The evidence grid: scans at their poses, gathered cell by cell."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter

from config.schema import Map
from mapping.beam import HINT_LOG_ODDS, PolarEvidence
from mapping.tiles import TILE, reaches_of, tiles_of
from mapping.values import FREE, OCCUPIED, UNKNOWN, Grid, Pose

CLAMP_OCCUPIED = 4.6
CLAMP_FREE = -3.5
"""Log-odds are held within these, so that a mistake can be unlearnt."""
BESIDE_M = 0.1
MUCH_MORE = 2.5
"""A wall cell is a hint where so many times its evidence stands within this of it: what is there is the same wall."""
MARGIN_CELLS = 2
SAME_M, SAME_RAD = 0.004, math.radians(0.1)
"""A scan is not drawn anew for less."""

Placed = tuple[Pose, PolarEvidence]


@dataclass(frozen=True, slots=True)
class Cells:
    """What one scan says at its pose, cell by cell: ``row``, ``col`` ``(k,)`` int32 from the origin, each cell once.

    ``log_odds`` ``(k,)`` float32 are not 0.
    """

    row: NDArray[np.int32]
    col: NDArray[np.int32]
    log_odds: NDArray[np.float32]


@dataclass(frozen=True, slots=True)
class _Kept:
    """A scan's cells at a pose, and how far it says anything, of ``mapping.tiles``."""

    evidence: PolarEvidence
    reaches_m: NDArray[np.float64]
    pose: Pose
    cells: Cells


class Canvas:
    """Works out a scan's cells, anew only where its pose moved by more than one would see.

    It keeps the cells of all scans, or of the ``most`` that were worked out last.
    """

    def __init__(self, config: Map, most: int | None = None) -> None:
        self._config, self._most = config, most
        # The evidence is kept with its cells, so that its id stays its own.
        self._kept: dict[int, _Kept] = {}

    def cells(self, pose: Pose, evidence: PolarEvidence) -> Cells:
        """Cells of a scan at a pose, or at the pose next to it at which they were drawn before."""
        known = self._kept.get(id(evidence))
        if known is None or not _same(known.pose, pose):
            reaches_m = reaches_of(evidence) if known is None else known.reaches_m
            known = _Kept(evidence, reaches_m, pose, cells_of(pose, evidence, self._config.cell_m, reaches_m))
            self._kept.pop(id(evidence), None)
            self._kept[id(evidence)] = known
            if self._most is not None and len(self._kept) > self._most:
                del self._kept[next(iter(self._kept))]
        return known.cells


def _same(a: Pose, b: Pose) -> bool:
    turned = (a.heading_rad - b.heading_rad + math.pi) % (2.0 * math.pi) - math.pi
    return abs(turned) < SAME_RAD and abs(a.x_m - b.x_m) < SAME_M and abs(a.y_m - b.y_m) < SAME_M


def empty(config: Map) -> Grid:
    """Give a grid of no cells."""
    return Grid(config.cell_m, 0.0, 0.0, np.zeros((0, 0), np.float32), np.zeros((0, 0), np.uint8))


def render(placed: Sequence[Placed], config: Map) -> Grid:
    """Draw scans at their poses into a grid as large as they need, its edges on multiples of the cell."""
    return gather([cells_of(pose, evidence, config.cell_m) for pose, evidence in placed], config)


def cells_of(pose: Pose, evidence: PolarEvidence, cell_m: float, reaches_m: NDArray[np.float64] | None = None) -> Cells:
    """Bring one scan into the map's cells: each cell's centre looks up its own bearing and range.

    ``reaches_m`` is what ``reaches_of`` gives, where it is known.
    """
    table = evidence.log_odds
    reaches_m = reaches_of(evidence) if reaches_m is None else reaches_m
    south, west = tiles_of(pose, evidence, reaches_m, cell_m)
    rows = south[:, None] + np.arange(TILE)
    cols = west[:, None] + np.arange(TILE)
    y = ((rows + 0.5) * cell_m - pose.y_m).astype(np.float32)[:, :, None]
    x = ((cols + 0.5) * cell_m - pose.x_m).astype(np.float32)[:, None, :]
    turn = np.arctan2(x, y) - np.float32(pose.heading_rad)
    bearing = np.floor(turn * (table.shape[0] / (2.0 * math.pi)) + 0.5).astype(np.intp) % table.shape[0]
    reached = (np.sqrt(x * x + y * y) / evidence.range_step_m).astype(np.intp)
    told = np.where(reached < table.shape[1], table[bearing, np.minimum(reached, table.shape[1] - 1)], 0.0)
    tile, row, col = np.nonzero(told)
    at = rows[tile, row].astype(np.int32), cols[tile, col].astype(np.int32)
    return Cells(*at, told[tile, row, col].astype(np.float32))


def gather(scans: Sequence[Cells], config: Map) -> Grid:
    """Add up what scans say, in their order; hints do not add up, and where more is known they say nothing."""
    told = [scan for scan in scans if len(scan.row)]
    if not told:
        return empty(config)
    south, north = min(int(s.row.min()) for s in told), max(int(s.row.max()) for s in told)
    west, east = min(int(s.col.min()) for s in told), max(int(s.col.max()) for s in told)
    shape = (north - south + 1, east - west + 1)
    log_odds = added(told, shape, (south, west), config.cell_m).astype(np.float32)
    return trim(np.pad(log_odds, MARGIN_CELLS), (south, west), config)


def added(
    scans: Sequence[Cells], shape: tuple[int, ...], corner: tuple[int, int], cell_m: float
) -> NDArray[np.float64]:
    """Add up log-odds, thinned and clamped, into ``shape`` cells from ``corner``, the row and column of their first."""
    total, hints = np.zeros(shape[0] * shape[1]), np.zeros(shape[0] * shape[1])
    for scan in scans:
        cell = (scan.row - corner[0]) * shape[1] + (scan.col - corner[1])
        hint = (scan.log_odds > 0.0) & (scan.log_odds <= HINT_LOG_ODDS)
        total[cell] += np.where(hint, 0.0, scan.log_odds)
        hints[cell] = np.maximum(hints[cell], np.where(hint, scan.log_odds, 0.0))
    told = np.where(total >= 0.0, np.maximum(total, hints), total).reshape(shape)
    return np.clip(thinned(told, cell_m), CLAMP_FREE, CLAMP_OCCUPIED)


def thinned(log_odds: NDArray[np.float64], cell_m: float) -> NDArray[np.float64]:
    """Leave of each wall the place of which most was told; less is a hint where it stands beside much more.

    Scans err by centimetres, and nothing is told open behind a wall: what one of them measured too far would stay.
    """
    reach = max(1, round(BESIDE_M / cell_m))
    long, short = 2 * reach + 1, 2 * reach - 1  # nearly a disc, and quick
    most = np.maximum(*(maximum_filter(log_odds, size, mode="constant") for size in ((long, short), (short, long))))
    return np.where((log_odds > HINT_LOG_ODDS) & (MUCH_MORE * log_odds < most), HINT_LOG_ODDS, log_odds)


def trim(log_odds: NDArray[np.float32], corner: tuple[int, int], config: Map) -> Grid:
    """Cut a grid to what it knows and a margin, and tell the state of each cell.

    ``corner`` is the cell at the south-west within the margin that the grid already has.
    """
    known = log_odds != 0.0
    if not known.any():
        return empty(config)
    rows = np.flatnonzero(known.any(axis=1))
    cols = np.flatnonzero(known.any(axis=0))
    south, west = int(rows[0]) - MARGIN_CELLS, int(cols[0]) - MARGIN_CELLS
    kept = np.ascontiguousarray(log_odds[south : rows[-1] + 1 + MARGIN_CELLS, west : cols[-1] + 1 + MARGIN_CELLS])
    x0_m, y0_m = (corner[1] + west - MARGIN_CELLS) * config.cell_m, (corner[0] + south - MARGIN_CELLS) * config.cell_m
    return Grid(config.cell_m, x0_m, y0_m, kept, states(kept, config))


def states(log_odds: NDArray[np.float32], config: Map) -> NDArray[np.uint8]:
    """Tell unknown, free and occupied apart at the configured probabilities."""
    occupied, free = config.occupied_threshold, config.free_threshold
    state = np.full(log_odds.shape, UNKNOWN, dtype=np.uint8)
    state[(log_odds < 0.0) & (log_odds <= math.log(free / (1.0 - free)))] = FREE
    state[(log_odds > 0.0) & (log_odds >= math.log(occupied / (1.0 - occupied)))] = OCCUPIED
    return state
