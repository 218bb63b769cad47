"""``method = "paper"``: hole filling after Forrester et al. 2013, as printed, in the values of this program.

Two things differ, because this program promises them: fills stay in a layer of their own, and a hole whose fill would
cross water seen free is left out (``paper_loop.raw_holes`` has it as printed).  A curve that the grid's walls cut into
pieces becomes a hole a piece.  What is learnt of a site is told by closed forms (``paper_learning``).  The paper knows
no certainty of a whole hole: the least of its cells stands for it.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from fill.paper_curve import CertaintyCurve, certainty_curves
from fill.paper_learning import LEARNABLE, learn
from fill.paper_loop import PaperHole, open_holes
from fill.paper_segments import find_paths
from fill.values import Hole
from mapping.values import OCCUPIED, Grid

_NAMES: Final = {1: "line", 2: "quadratic", 3: "cubic"}
_LEAST: Final = 0.01  # certainty 0 means that nothing is filled


def paper_fill(grid: Grid, longest: float, random: np.random.Generator) -> tuple[tuple[Hole, ...], NDArray[np.float64]]:
    """Fill holes of ``grid`` up to ``longest`` cells.

    Returns the holes, and the places ``(n, 2)`` of endpoints left open, x and y in cells.
    """
    wall = grid.state == OCCUPIED
    curves = certainty_curves(learn(find_paths(wall, LEARNABLE), wall, random))
    found, left = open_holes(grid.state, longest)
    pieces = [(hole, piece) for hole in found for piece in _pieces(hole)]
    holes = tuple(_hole(index, hole, piece, curves, grid) for index, (hole, piece) in enumerate(pieces))
    return holes, left[:, ::-1].astype(np.float64)


def cell_certainty(hole: PaperHole, curves: dict[int, CertaintyCurve]) -> NDArray[np.float32]:
    """Certainty ``(n,)`` of a hole's cells by the curve of its order."""
    return np.maximum(curves[hole.order].certainty(hole.away), _LEAST).astype(np.float32)


def _pieces(hole: PaperHole) -> Iterator[NDArray[np.int64]]:
    """Yield the indices of the cells that hang together."""
    low = hole.cells.min(axis=0)
    mask = np.zeros(tuple(hole.cells.max(axis=0) - low + 1), bool)
    rows, cols = (hole.cells - low).T
    mask[rows, cols] = True
    parts, count = ndimage.label(mask, np.ones((3, 3)))
    for number in range(1, count + 1):
        yield np.flatnonzero(parts[rows, cols] == number)


def _hole(index: int, hole: PaperHole, piece: NDArray[np.int64], curves: dict[int, CertaintyCurve], grid: Grid) -> Hole:
    certainty = cell_certainty(hole, curves)[piece]
    corner_m = np.array([grid.x0_m, grid.y0_m])
    ends_m = (hole.ends[:, ::-1].astype(np.float64) + 0.5) * grid.cell_m + corner_m
    gap_m = float(np.hypot(*(hole.ends[1] - hole.ends[0]))) * grid.cell_m
    least = float(certainty.min())
    why = (
        f"a polynomial of order {hole.order} fits both ends best, over {gap_m:.2f} m; its cells right with {least:.0%}"
    )
    cells = hole.cells[piece].astype(np.int32)
    return Hole(index, cells, certainty, least, ends_m, gap_m, _NAMES[hole.order], f"{why} or more")
