"""A map with simulated losses, and what was lost where."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

Kind = Literal["stretch", "shadow", "opening seen", "opening unseen"]
ELSEWHERE: Final = -1
UNJUDGED: Final = -2
LONGEST: Final = 40.0
"""Cells: longest gap that is simulated, and that every method is told to close."""


@dataclass(frozen=True, slots=True)
class Loss:
    """One loss: ``line`` ``(n, 2)`` int64 of row and column is the lost part of a wall's centre line.

    Of an opening it is the line between its jambs, which must not become wall, and ``banks`` are the cells ``(m, 3)``
    of the passage: row, column, and 1 or 2 where the cell lies on one or the other side, else 0.
    """

    kind: Kind
    line: NDArray[np.int64]
    gap: float
    banks: NDArray[np.int64]

    @property
    def opening(self) -> bool:
        """Whether nothing is to be filled here."""
        return self.kind.startswith("opening")


@dataclass(frozen=True, slots=True)
class Damaged:
    """A piece of a real map with losses.

    ``truth``, ``seen`` ``(rows, cols)`` uint8 are the states before and after; ``owner`` ``(rows, cols)`` int32 the
    index of the loss that a fill there belongs to, ELSEWHERE, or UNJUDGED where too much is gone to judge.
    """

    name: str
    truth: NDArray[np.uint8]
    seen: NDArray[np.uint8]
    losses: tuple[Loss, ...]
    owner: NDArray[np.int32]


def owners(shape: tuple[int, ...], losses: list[Loss], unjudged: NDArray[np.bool_]) -> NDArray[np.int32]:
    """Give each cell near a loss to the nearest one, however far a fill of it might wander."""
    owner = np.where(ndimage.binary_dilation(unjudged, iterations=4), UNJUDGED, ELSEWHERE).astype(np.int32)
    closest = np.full(shape, np.inf)
    for index, loss in enumerate(losses):
        bare = np.ones(shape, bool)
        bare[loss.line[:, 0], loss.line[:, 1]] = False
        away = ndimage.distance_transform_edt(bare)
        mine = (away <= max(4.0, loss.gap / 2.0)) & (away < closest)
        owner[mine] = index
        closest[mine] = away[mine]
    return owner
