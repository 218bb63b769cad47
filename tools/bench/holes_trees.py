"""Growing boosted trees on lessons, and writing them down as tables.

Trees are grown by second order gradients of the logistic loss, each on a part of the lessons and a part of the
features, so that none learns one place by heart.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fill.logistic import sigmoid
from mapping.trees import PER_ONE, Table

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

_CUTS: Final = 15  # places at which a feature may be split: every sixteenth of what was seen
_LEAST: Final = 3.0  # curvature of the loss in a leaf
_LESSONS: Final = 0.6
_FEATURES: Final = 0.5
_SEED: Final = 1
_LINE: Final = 110


@dataclass(frozen=True, slots=True)
class Growth:
    """How trees are grown: how many, how deep, the share ``rate`` that each adds of what is missing, and a ridge."""

    count: int
    depth: int
    rate: float
    ridge: float


@dataclass(frozen=True, slots=True)
class Grown:
    """Grown trees: ``cuts`` of each feature, and of each tree the ``feature``, ``cut`` and ``leaf``, level by level."""

    base: int
    cuts: tuple[Floats, ...]
    feature: Ints
    cut: Ints
    leaf: Ints

    def log_odds(self, x: Floats) -> Floats:
        """Log-odds ``(n,)`` for features ``(n, k)``."""
        bins = _binned(x, self.cuts)
        total = np.full(len(x), self.base)
        for feature, cut, leaf in zip(self.feature, self.cut, self.leaf, strict=True):
            total += leaf[_walk(bins, feature, cut)]
        return np.asarray(total / PER_ONE, np.float64)


def grow(x: Floats, right: Floats, count: Floats, growth: Growth) -> Grown:
    """Grow trees on lessons ``x`` ``(n, k)``, ``right`` ``(n,)`` of 0 or 1, each counting as ``count`` ``(n,)``."""
    random = np.random.default_rng(_SEED)
    cuts = tuple(np.unique(_short(np.quantile(each, np.linspace(0.0, 1.0, _CUTS + 2)[1:-1]))) for each in x.T)
    bins = _binned(x, cuts)
    good = float(count @ right) / float(count.sum())
    base = round(PER_ONE * float(np.log(good / (1.0 - good))))
    told = np.full(len(x), base / PER_ONE)
    grown = []
    for _ in range(growth.count):
        chance = sigmoid(told)
        slope, bend = count * (right - chance), count * chance * (1.0 - chance)
        rows = np.flatnonzero(random.random(len(x)) < _LESSONS)
        columns = np.sort(random.choice(x.shape[1], max(1, int(_FEATURES * x.shape[1])), replace=False))
        feature, cut = _splits(bins[rows], slope[rows], bend[rows], columns, growth)
        at = _walk(bins, feature, cut)
        sums = (np.bincount(at[rows], each[rows], 2**growth.depth) for each in (slope, bend))
        above, below = sums
        leaf = np.rint(PER_ONE * growth.rate * above / (below + growth.ridge)).astype(np.int64)
        told += leaf[at] / PER_ONE
        grown.append((feature, cut, leaf))
    return Grown(base, cuts, *(np.array(each) for each in zip(*grown, strict=True)))


def table(grown: Grown, names: tuple[str, ...]) -> Table:
    """Return trees as ``mapping.trees.planted`` reads them; features that no tree uses are left out."""
    used = np.unique(grown.feature)
    most = np.array([len(grown.cuts[index]) for index in used])
    rank = np.searchsorted(used, grown.feature)
    # No split: the cut after the last, where nothing goes to the second branch.
    cut = np.where(grown.cut < most[rank], grown.cut, most.max())
    rows = np.concatenate([rank, cut, grown.leaf], axis=1).ravel().tolist()
    depth = int(np.log2(grown.leaf.shape[1]))
    places = [value for index in used.tolist() for value in (len(grown.cuts[index]), *grown.cuts[index].tolist())]
    return Table(
        _wrapped([names[index] for index in used.tolist()], " | "),
        _wrapped([f"{value:.3g}" for value in places], " "),
        _wrapped([str(value) for value in (grown.base, depth, *rows)], " "),
    )


def _wrapped(words: list[str], between: str) -> str:
    """Join words to lines that fit a page."""
    lines = [words[0]]
    for word in words[1:]:
        longer = f"{lines[-1]}{between}{word}"
        lines[-1:] = [longer] if len(longer) <= _LINE else [lines[-1], word]
    return "\n".join(lines)


def _short(values: Floats) -> Floats:
    """Round to what is written down, so that what was grown is what is read."""
    return np.array([float(f"{value:.3g}") for value in values])


def _binned(x: Floats, cuts: tuple[Floats, ...]) -> Ints:
    """Return how many cuts each value is above, ``(n, k)``."""
    return np.stack([np.searchsorted(each, x[:, index], side="left") for index, each in enumerate(cuts)], axis=1)


def _walk(bins: Ints, feature: Ints, cut: Ints) -> Ints:
    """Return the leaf that each row ends in."""
    at, rows = np.zeros(len(bins), np.int64), np.arange(len(bins))
    while len(at) and at[0] < len(feature):
        at = 2 * at + 1 + (bins[rows, feature[at]] > cut[at])
    return at - len(feature)


def _splits(bins: Ints, slope: Floats, bend: Floats, columns: Ints, growth: Growth) -> tuple[Ints, Ints]:
    """Return features and cuts of one tree, level by level, each the best that its branch has."""
    node = np.zeros(len(bins), np.int64)
    features, cuts = [], []
    for level in range(growth.depth):
        gains = _gains(bins[:, columns], node, slope, bend, 2**level, growth.ridge).reshape(2**level, -1)
        best = gains.argmax(axis=1)
        feature = columns[best // (_CUTS + 1)]
        cut = np.where(gains.max(axis=1) > 0.0, best % (_CUTS + 1), _CUTS)
        node = 2 * node + (bins[np.arange(len(bins)), feature[node]] > cut[node])
        features.append(feature)
        cuts.append(cut)
    return np.concatenate(features), np.concatenate(cuts)


def _gains(bins: Ints, node: Ints, slope: Floats, bend: Floats, nodes: int, ridge: float) -> Floats:
    """Gains ``(nodes, k, cuts)`` of splitting each branch at each place."""
    places = _CUTS + 1
    shape = bins.shape[1], nodes, places
    sums = []
    for each in (slope, bend):
        counted = [np.bincount(node * places + column, each, nodes * places) for column in bins.T]
        sums.append(np.array(counted).reshape(shape).cumsum(axis=2).transpose(1, 0, 2))
    above, below = sums
    all_above, all_below = above[..., -1:], below[..., -1:]
    gains = above**2 / (below + ridge) + (all_above - above) ** 2 / (all_below - below + ridge)
    gains -= all_above**2 / (all_below + ridge)
    gains[(below < _LEAST) | (all_below - below < _LEAST)] = 0.0
    return np.asarray(gains, np.float64)
