"""How sure a fill is: models learnt on other places, set right by the site's own walls.

The paper tabulates hits by distance and runs a cubic through them (section 3.1.2), which leaves 0 to 1 beyond its last
bin.  Here a cell's certainty hangs on what speaks for it and for its hole (``witness``), as learnt on other
places (``prior``).  What the site's own knocked-out holes teach moves a level and a slope on top of that, no further
than sites were found to differ.  Nothing is told beyond what was learnt: trees know no trend beyond their last cut,
and a gap longer than any learnt is told less sure the longer it is, and marked.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fill.logistic import Logistic, sigmoid
from fill.witness import CELL_FEATURES, HOLE_FEATURES
from mapping.trees import Trees

LOWEST: Final = 0.02
HIGHEST: Final = 0.995
"""Nothing guessed is told as sure."""
_WIDER: Final = 16.0  # variance that a gap e times as long as any learnt adds to the log-odds
_LOG_GAP: Final = HOLE_FEATURES.index("log gap")

DESIGN: Final = (*HOLE_FEATURES, *CELL_FEATURES)
"""What the model of cells weighs, in this order."""


@dataclass(frozen=True, slots=True)
class Learnt:
    """What is learnt of cells: ``trees`` over ``DESIGN``, and the logarithm of the ``longest`` gap learnt on."""

    trees: Trees
    longest: float

    def log_odds(self, hole: NDArray[np.float64], cells: NDArray[np.float64]) -> NDArray[np.float64]:
        """Log-odds ``(n,)`` that the cells of a fill are right."""
        return self.trees.log_odds(design_of(hole, cells)) * self.damped(hole)

    def excess(self, hole: NDArray[np.float64]) -> float:
        """Logarithm of how many times longer than any learnt the gap is; 0 within what was learnt."""
        return max(0.0, float(hole[_LOG_GAP] - self.longest))

    def damped(self, hole: NDArray[np.float64]) -> float:
        """Return the share of the log-odds that is left where the gap is longer than any learnt."""
        return 1.0 / math.sqrt(1.0 + math.pi / 8.0 * _WIDER * self.excess(hole) ** 2)


@dataclass(frozen=True, slots=True)
class Belief:
    """What is believed about fills.

    ``hole`` judges candidates, so that ends can be matched; ``cell`` the cells of what was closed; ``site`` moves the
    log-odds of cells by a level and a slope; ``whole`` tells from the cells whether a fill is right as a whole.
    """

    hole: Trees
    cell: Learnt
    site: Logistic
    whole: NDArray[np.float64]

    def certainties(
        self, log_odds: Sequence[NDArray[np.float64]], away: Sequence[NDArray[np.float64]]
    ) -> list[NDArray[np.float32]]:
        """Certainties ``(n,)`` of each fill's cells, ``away`` ``(n,)`` cells from what was measured; never growing."""
        if not log_odds:
            return []
        told = self.site.weights[0] + self.site.weights[1] * np.concatenate(log_odds)
        chance = np.clip(sigmoid(told), LOWEST, HIGHEST)
        counts = np.array([len(each) for each in away])
        fallen = all_falling(chance, np.concatenate(away), counts).astype(np.float32)
        return np.split(fallen, np.cumsum(counts)[:-1])

    def hole_certainties(self, certainties: Sequence[NDArray[np.float32]]) -> NDArray[np.float64]:
        """Certainties ``(m,)`` that whole fills are right, from those of their cells ``(n,)``."""
        told = np.sum(whole_features(certainties) * self.whole, axis=1)
        return np.clip(sigmoid(told), LOWEST, HIGHEST)


def design_of(hole: NDArray[np.float64], cells: NDArray[np.float64]) -> NDArray[np.float64]:
    """Features ``(n, k)`` after ``DESIGN`` of the cells of one fill."""
    return np.concatenate([np.repeat(hole[None], len(cells), axis=0), cells], axis=1)


def falling(chance: NDArray[np.float64], away: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the nearest values to ``chance`` ``(n,)`` that do not grow with ``away`` ``(n,)``: means of neighbours."""
    return all_falling(chance, away, np.array([len(chance)]))


def all_falling(
    chance: NDArray[np.float64], away: NDArray[np.float64], counts: NDArray[np.int64]
) -> NDArray[np.float64]:
    """Let each of several runs of values fall, as ``falling`` does; they lie behind each other, ``counts`` long."""
    run = np.repeat(np.arange(len(counts)), counts)
    order = np.lexsort((-chance, away, run))
    totals: list[float] = []
    members: list[int] = []
    first, last = 0, -1
    for value, index in zip(chance[order].tolist(), run.tolist(), strict=True):
        if index != last:
            first, last = len(totals), index
        total, count = value, 1
        while len(totals) > first and totals[-1] * count <= total * members[-1]:
            total, count = total + totals.pop(), count + members.pop()
        totals.append(total)
        members.append(count)
    fallen = np.empty(len(chance))
    fallen[order] = np.repeat(np.array(totals) / np.array(members), members)
    return fallen


def whole_features(certainties: Sequence[NDArray[np.float32]]) -> NDArray[np.float64]:
    """Features ``(m, 4)`` of whole fills: one, log-odds of the least sure cell and of the mean, log of their number."""
    if not certainties:
        return np.zeros((0, 4))
    count = np.array([len(each) for each in certainties])
    first = np.cumsum(count) - count
    cells = np.concatenate(certainties).astype(np.float64)
    least, mean = np.minimum.reduceat(cells, first), np.add.reduceat(cells, first) / count
    return np.stack([np.ones_like(least), log_odds(least), log_odds(mean), np.log(count)], axis=1)


def log_odds(chance: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the log-odds of probabilities, held within what is told."""
    held = np.clip(chance, LOWEST, HIGHEST)
    return np.asarray(np.log(held / (1.0 - held)), np.float64)
