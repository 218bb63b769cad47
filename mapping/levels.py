"""Levels: which scans show the same plan.

Wells taper: a scan made deeper sees other walls than the one before, and rings of several levels in one grid wipe each
other out, for the water that one saw open is the wall of another.  Where a passage goes down, walls go on.  So scans
of another depth belong to the plan unless they contradict it more than they confirm it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_dilation

from config.schema import Map
from mapping.beam import HINT_LOG_ODDS
from mapping.grid import Cells, gather
from mapping.pieces import LEVEL_M
from mapping.values import FREE, OCCUPIED, Grid

CONTRARY: Final = 0.5
"""A scan with more contradictions to a plan than this share of what it confirms shows another plan."""

Flags = NDArray[np.bool_]


def levels_of(depths_m: Sequence[float], cells: Sequence[Cells], config: Map) -> list[list[int]]:
    """Sort scans into plans, each a list of their numbers in order; the first holds the first scan.

    ``depths_m`` are nan where no depth was told: such a scan is of the first plan.
    """
    left = list(range(len(cells)))
    plans: list[list[int]] = []
    while left:
        near = [k for k in left if not abs(depths_m[k] - depths_m[left[0]]) > LEVEL_M]
        if len(near) < len(left):
            plan = gather([cells[k] for k in near], config)
            near = [k for k in left if k in near or not contradicts(cells[k], plan)]
        plans.append(near)
        left = [k for k in left if k not in near]
    return plans


def contradicts(scan: Cells, plan: Grid) -> bool:
    """Whether a scan shows other walls than a plan where both tell."""
    row = scan.row - round(plan.y0_m / plan.cell_m)
    col = scan.col - round(plan.x0_m / plan.cell_m)
    inside = (row >= 0) & (row < plan.state.shape[0]) & (col >= 0) & (col < plan.state.shape[1])
    wall = scan.log_odds[inside] > HINT_LOG_ODDS
    open_water = scan.log_odds[inside] < 0.0
    state = plan.state[row[inside], col[inside]]
    near_wall = _near(plan.state == OCCUPIED)[row[inside], col[inside]]
    confirmed = int((wall & near_wall).sum())
    against = int((wall & (state == FREE) & ~near_wall).sum()) + int((open_water & (state == OCCUPIED)).sum())
    return against > CONTRARY * confirmed


def _near(walls: Flags) -> Flags:
    return np.asarray(binary_dilation(walls, np.ones((3, 3), dtype=bool)))
