"""Boosted trees: many small decision trees whose leaves are summed to log-odds.

What tells a hole from an opening hangs together in ways that no weighted sum holds: water on both sides speaks for a
wall where its edge runs along the way, and against one where it bulges.  Leaves are whole numbers, so that a sum is
the same in whatever company a row is judged.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

PER_ONE: Final = 1000
"""Leaves count in thousandths of log-odds."""


@dataclass(frozen=True, slots=True)
class Table:
    """Trees as text, in lines of any length.

    ``features`` that are used, parted by bars; ``cuts``: for each of these how many places it may be split at, and the
    places; ``trees``: the base, the depth, and for each tree the features of its splits by their number above, their
    cuts by number, and its leaves.
    """

    features: str
    cuts: str
    trees: str


@dataclass(frozen=True, slots=True)
class Trees:
    """Trees that are all of one depth d.

    ``feature`` ``(t, 2**d - 1)`` int64 and ``cut`` ``(t, 2**d - 1)`` float64 level by level: what is more than the cut
    goes to the second branch; ``leaf`` ``(t, 2**d)`` int64 in thousandths; ``base`` likewise.
    """

    base: int
    feature: NDArray[np.int64]
    cut: NDArray[np.float64]
    leaf: NDArray[np.int64]

    def log_odds(self, features: NDArray[np.float64]) -> NDArray[np.float64]:
        """Log-odds ``(n,)`` for features ``(n, k)``."""
        trees = np.arange(len(self.feature))
        rows = np.arange(len(features))[:, None]
        at = np.zeros((len(features), len(trees)), np.int64)
        while at.size and at[0, 0] < self.feature.shape[1]:
            at = 2 * at + 1 + (features[rows, self.feature[trees, at]] > self.cut[trees, at])
        total = self.base + np.sum(self.leaf[trees, at - self.feature.shape[1]], axis=1)
        return np.asarray(total / PER_ONE, np.float64)

    def chance(self, features: NDArray[np.float64]) -> NDArray[np.float64]:
        """Probability ``(n,)`` for features ``(n, k)``."""
        return sigmoid(self.log_odds(features))


def planted(table: Table, names: tuple[str, ...]) -> Trees:
    """Read trees from a table.  Raises ValueError where it has a feature that is none of ``names``."""
    used = [names.index(name.strip()) for name in table.features.replace("\n", "|").split("|")]
    places = _places([float(value) for value in table.cuts.split()], len(used))
    base, depth, *rest = (int(value) for value in table.trees.split())
    splits = 2**depth - 1
    numbers = np.array(rest, np.int64).reshape(-1, 3 * splits + 1)
    feature, cut = numbers[:, :splits], numbers[:, splits : 2 * splits]
    return Trees(base, np.array(used)[feature], places[feature, cut], numbers[:, 2 * splits :])


def _places(written: list[float], features: int) -> NDArray[np.float64]:
    """Cuts ``(features, most + 1)``; those that are not there let everything go to the first branch."""
    rows = []
    for _ in range(features):
        count = int(written[0])
        rows.append(written[1 : count + 1])
        written = written[count + 1 :]
    places = np.full((features, max(len(row) for row in rows) + 1), np.inf)
    for row, values in zip(places, rows, strict=True):
        row[: len(values)] = values
    return places


def sigmoid(x: NDArray[np.float64]) -> NDArray[np.float64]:
    """Logistic function, safe for any size of ``x``."""
    return 0.5 * (1.0 + np.tanh(0.5 * x))
