"""Methods of filling, each from the damaged grid alone: ours, the paper's, and simple ones that anybody would try."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.spatial.distance import cdist
from skimage.draw import line as line_cells
from skimage.restoration import inpaint_biharmonic

from config.schema import Fill
from fill.filler import Filler
from fill.paper import cell_certainty, paper_fill
from fill.paper_curve import certainty_curves
from fill.paper_loop import raw_holes
from fill.segments import find_walls
from mapping.values import FREE, OCCUPIED, UNKNOWN, Grid
from tools.bench.holes_diffusion import diffusion
from tools.bench.holes_judge import Proposal
from tools.bench.holes_loss import LONGEST
from tools.bench.holes_printed import knock_outs

State = NDArray[np.uint8]
Method = Callable[[State], Proposal]

_CELL_M: Final = 0.05
_REACH: Final = LONGEST + 2.0  # cells: a gap is measured from the faces of its ends, which lie a little apart
_CLOSING: Final = 6  # cells from the middle of the square to its side
_INPAINT: Final = 12.0  # cells from wall that are painted
_SEED: Final = 1


def ours(state: State) -> Proposal:
    """Fill with the program as it is."""
    filled = Filler(Fill(max_gap_m=_REACH * _CELL_M)).update(_grid(state))
    return Proposal(filled.hole >= 0, filled.certainty)


def lines(state: State) -> Proposal:
    """Join ends that are nearest to each other and look at each other, by a straight line that crosses no water."""
    filled = np.zeros(state.shape, bool)
    ends = find_walls(state == OCCUPIED).ends
    if len(ends) < 2:
        return Proposal(filled, None)
    places = np.array([(end.x, end.y) for end in ends])
    aims = np.array([(end.dx, end.dy) for end in ends])
    away = cdist(places, places)
    ahead = np.einsum("ijk,ik->ij", places[None] - places[:, None], aims) > 0
    away[~(ahead & ahead.T) | (away > _REACH)] = np.inf
    nearest = np.argmin(away, axis=1)
    for a, b in enumerate(nearest.tolist()):
        if a < b and nearest[b] == a and np.isfinite(away[a, b]):
            row_a, col_a, row_b, col_b = (round(float(value)) for value in (*places[a][::-1], *places[b][::-1]))
            rows, cols = line_cells(row_a, col_a, row_b, col_b)  # type: ignore[no-untyped-call]
            inside = (rows >= 0) & (rows < state.shape[0]) & (cols >= 0) & (cols < state.shape[1])
            if not np.any(state[rows[inside], cols[inside]] == FREE):
                filled[rows[inside], cols[inside]] = True
    return Proposal(filled & (state == UNKNOWN), None)


def closing(state: State) -> Proposal:
    """Close the walls morphologically, by a square: a disc does not close gaps in walls thinner than itself."""
    side = 2 * _CLOSING + 1
    closed = ndimage.binary_closing(np.pad(state == OCCUPIED, side), np.ones((side, side), np.int8))
    inner = slice(side, -side)
    return Proposal(np.asarray(closed[inner, inner] & (state == UNKNOWN), np.bool_), None)


def inpainting(state: State) -> Proposal:
    """Paint the unknown cells near walls biharmonically."""
    wall = state == OCCUPIED
    if not wall.any():
        return Proposal(wall, None)
    mask = (state == UNKNOWN) & (ndimage.distance_transform_edt(~wall) <= _INPAINT)
    image = np.asarray(inpaint_biharmonic(wall.astype(np.float64), mask), np.float64)
    return Proposal(mask & (image > 0.5), None)


def paper_as_printed(state: State) -> Proposal:
    """Fill as the paper prints it, over water as well."""
    filled, certainty = np.zeros(state.shape, bool), np.zeros(state.shape, np.float32)
    curves = certainty_curves(knock_outs(state == OCCUPIED, np.random.default_rng(_SEED)))
    for hole in raw_holes(state, _REACH):
        rows, cols = hole.cells.T
        filled[rows, cols] = True
        certainty[rows, cols] = cell_certainty(hole, curves)
    return Proposal(filled, certainty)


def paper_dry(state: State) -> Proposal:
    """Fill as ``method = "paper"`` does in the program, which leaves out what would cross water."""
    filled, certainty = np.zeros(state.shape, bool), np.zeros(state.shape, np.float32)
    for hole in paper_fill(_grid(state), _REACH, np.random.default_rng(_SEED))[0]:
        rows, cols = hole.cells.T
        filled[rows, cols] = True
        certainty[rows, cols] = hole.certainty
    return Proposal(filled, certainty)


METHODS: Final[dict[str, Method]] = {
    "ours": ours,
    "lines between mutual nearest ends": lines,
    "paper, water kept open": paper_dry,
    "paper as printed": paper_as_printed,
    "volumetric diffusion": diffusion,
    "biharmonic inpainting": inpainting,
    "morphological closing": closing,
}
"""By the name that they have in the table."""


def _grid(state: State) -> Grid:
    log_odds = np.select([state == FREE, state == OCCUPIED], [-2.0, 2.0], 0.0).astype(np.float32)
    return Grid(_CELL_M, 0.0, 0.0, log_odds, state)
