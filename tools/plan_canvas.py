"""The plan's raster: how cells become pixels, with hatches so that no class is told by its colour alone."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, TypeVar

import numpy as np
from numpy.typing import NDArray

from fill.values import Filled
from mapping.values import FREE, OCCUPIED, UNKNOWN

Colour = tuple[int, int, int]
Cell = TypeVar("Cell", np.uint8, np.int32, np.float32)

FREE_WATER: Final[Colour] = (219, 236, 246)
NEVER_SEEN: Final[Colour] = (240, 240, 238)
NEVER_SEEN_HATCH: Final[Colour] = (218, 218, 214)
WALL: Final[Colour] = (25, 25, 30)
FILL_SURE: Final[Colour] = (196, 78, 0)
FILL_UNSURE: Final[Colour] = (252, 205, 150)
FILL_STRIPE: Final[Colour] = (255, 250, 240)
INK: Final[Colour] = (35, 35, 40)
PAPER: Final[Colour] = (255, 255, 255)

_LONGEST_PX: Final = 1200
_MARGIN_CELLS: Final = 4
_HATCH_PX: Final = 9
_STRIPE_PX: Final = 6


@dataclass(frozen=True, slots=True)
class Frame:
    """Which cells are drawn, and how large: ``row0`` and ``col0`` are the first ones, north is up.

    ``px`` is the number of final pixels a cell, ``fine`` the supersampling: layers are drawn ``fine`` times larger.
    """

    row0: int
    col0: int
    rows: int
    cols: int
    px: int
    fine: int
    cell_m: float
    x0_m: float
    y0_m: float

    @property
    def width(self) -> int:
        """Final width in pixels."""
        return self.cols * self.px

    @property
    def height(self) -> int:
        """Final height in pixels."""
        return self.rows * self.px

    def place(self, x_m: float, y_m: float) -> tuple[float, float]:
        """Return the final pixel, right and down from the frame's corner, of a place in the map."""
        right = (x_m - self.x0_m) / self.cell_m - self.col0
        up = (y_m - self.y0_m) / self.cell_m - self.row0
        return right * self.px, (self.rows - up) * self.px


def frame_of(filled: Filled, places_m: NDArray[np.float64]) -> Frame:
    """Choose the part of the grid where something is known, with ``places_m`` ``(n, 2)`` of x and y inside too."""
    grid = filled.grid
    known = np.argwhere((grid.state != UNKNOWN) | (filled.hole >= 0))
    if len(places_m):
        places = np.floor((places_m[:, ::-1] - (grid.y0_m, grid.x0_m)) / grid.cell_m).astype(np.int64)
        known = np.concatenate([known, places])
    if not len(known):
        known = np.array([[0, 0], [max(grid.state.shape[0], 20) - 1, max(grid.state.shape[1], 20) - 1]])
    low, high = known.min(axis=0) - _MARGIN_CELLS, known.max(axis=0) + _MARGIN_CELLS + 1
    rows, cols = (int(each) for each in high - low)
    px = max(1, min(16, _LONGEST_PX // max(rows, cols)))
    fine = 2 if rows * cols * px * px < 6_000_000 else 1
    return Frame(int(low[0]), int(low[1]), rows, cols, px, fine, grid.cell_m, grid.x0_m, grid.y0_m)


def raster(filled: Filled, frame: Frame) -> NDArray[np.uint8]:
    """Pixels ``(height * fine, width * fine, 3)`` uint8 of the cells."""
    state = _enlarge(_window(filled.grid.state, frame, UNKNOWN), frame)
    hole = _enlarge(_window(filled.hole, frame, -1), frame) >= 0
    certainty = _enlarge(_window(filled.certainty, frame, 0), frame)
    pixels = np.empty((*state.shape, 3), np.uint8)
    diagonal = np.add.outer(np.arange(state.shape[0]), np.arange(state.shape[1])) // frame.fine
    pixels[:] = np.where((diagonal % _HATCH_PX < 1)[..., None], NEVER_SEEN_HATCH, NEVER_SEEN)
    pixels[state == FREE] = FREE_WATER
    pixels[state == OCCUPIED] = WALL
    pixels[hole] = fill_colours(certainty[hole])
    backward = np.subtract.outer(np.arange(state.shape[0]), np.arange(state.shape[1])) // frame.fine
    pixels[hole & (backward % _STRIPE_PX < 2)] = FILL_STRIPE
    return pixels


def fill_colours(certainty: NDArray[np.float32]) -> NDArray[np.uint8]:
    """Colour ``(n, 3)`` of filled cells: the darker the surer."""
    share = certainty.astype(np.float64)[:, None]
    mixed = share * np.array(FILL_SURE, np.float64) + (1.0 - share) * np.array(FILL_UNSURE, np.float64)
    colours: NDArray[np.uint8] = np.rint(mixed).astype(np.uint8)
    return colours


def _window(layer: NDArray[Cell], frame: Frame, outside: int) -> NDArray[Cell]:
    """Cut the frame out of a layer, with ``outside`` beyond its edges; row 0 of the result is north."""
    cut = np.full((frame.rows, frame.cols), outside, layer.dtype)
    top, left = max(frame.row0, 0), max(frame.col0, 0)
    bottom = min(frame.row0 + frame.rows, layer.shape[0])
    right = min(frame.col0 + frame.cols, layer.shape[1])
    if top < bottom and left < right:
        here = slice(top - frame.row0, bottom - frame.row0), slice(left - frame.col0, right - frame.col0)
        cut[here] = layer[top:bottom, left:right]
    return np.flipud(cut)


def _enlarge(layer: NDArray[Cell], frame: Frame) -> NDArray[Cell]:
    size = frame.px * frame.fine
    return layer.repeat(size, axis=0).repeat(size, axis=1)
