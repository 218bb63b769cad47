"""Judging one proposal for one damaged map: which cells are right, which losses are made good."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from mapping.values import FREE, OCCUPIED
from tools.bench.holes_gates import shut
from tools.bench.holes_loss import ELSEWHERE, Damaged, Loss

COVERED: Final = 0.9
"""A hole is right if so much of the lost line is covered, and nothing filled there is wrong."""
_EIGHT: Final = np.ones((3, 3), np.int8)


@dataclass(frozen=True, slots=True)
class Proposal:
    """What a method fills: layers ``(rows, cols)`` of cells ``filled`` and ``certainty``, None where it tells none."""

    filled: NDArray[np.bool_]
    certainty: NDArray[np.float32] | None


@dataclass(frozen=True, slots=True)
class LossVerdict:
    """What became of one loss.

    ``right`` ``(n,)`` bool of the cells filled there and their ``certainty`` ``(n,)`` (nan where none is told);
    ``covered`` of ``lost`` centre line cells have a filled cell within one cell; ``walled`` of an opening: no way
    through is left.
    """

    loss: Loss
    right: NDArray[np.bool_]
    certainty: NDArray[np.float64]
    covered: int
    lost: int
    walled: bool

    @property
    def good(self) -> bool:
        """Whether a hole is closed where the wall had been, and nowhere else."""
        return bool(self.right.all() and self.covered >= COVERED * self.lost)


@dataclass(frozen=True, slots=True)
class Verdict:
    """Verdicts of all losses of a map.

    ``elsewhere`` counts the cells filled far from any loss, of which nothing is known where the map has a hole of its
    own; ``denied`` those of them that lie in water which the map saw; ``over_water`` all cells over water seen.
    """

    losses: tuple[LossVerdict, ...]
    elsewhere: int
    denied: int
    over_water: int


def judge(damaged: Damaged, proposal: Proposal) -> Verdict:
    """Compare what was filled with what had stood there; a cell is right within one cell of true wall."""
    fresh = proposal.filled & (damaged.seen != OCCUPIED)
    wall = ndimage.binary_dilation(damaged.truth == OCCUPIED, _EIGHT)
    near_fill = ndimage.binary_dilation(fresh, _EIGHT)
    solid = (damaged.truth != FREE) | fresh
    verdicts = []
    for index, loss in enumerate(damaged.losses):
        mine = fresh & (damaged.owner == index)
        certainty = np.full(int(mine.sum()), np.nan) if proposal.certainty is None else proposal.certainty[mine]
        rows, cols = loss.line.T
        verdicts.append(
            LossVerdict(
                loss, wall[mine], certainty.astype(np.float64),
                0 if loss.opening else int(near_fill[rows, cols].sum()), 0 if loss.opening else len(rows),
                loss.opening and shut(loss.banks, solid),
            )
        )  # fmt: skip
    elsewhere = fresh & (damaged.owner == ELSEWHERE)
    denied = elsewhere & (damaged.truth == FREE) & ~wall
    counts = (int(each.sum()) for each in (elsewhere, denied, fresh & (damaged.seen == FREE)))
    return Verdict(tuple(verdicts), *counts)
