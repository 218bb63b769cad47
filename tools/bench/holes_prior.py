"""Fitting the prior of certainties to what became of fills in damaged maps: ``lacuna bench holes --fit-prior DIR``.

Each model is judged on places that it did not see: one map is left out at a time (several pieces and seeds of it
together), or all that is emulated, and the figures are over all of them.  Certainties are fitted to fills that were
chosen by models which had not seen their place, for what a model says of its own lessons is too good.  What is written
is fitted to all; the same command writes the same bytes.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fill.candidates import FEATURES
from fill.certainty import DESIGN, HIGHEST, LOWEST, falling, log_odds, whole_features
from fill.logistic import Logistic, sigmoid
from mapping.trees import planted
from tools.bench.holes_outcomes import Case, Filling, Tried, cases, filled, tried
from tools.bench.holes_trees import Grown, Growth, grow, table
from tools.files import replace_file

Row = dict[str, str | int | float]
Floats = NDArray[np.float64]

_HOLES: Final = Growth(count=100, depth=4, rate=0.15, ridge=5.0)
_CELLS: Final = Growth(count=120, depth=3, rate=0.1, ridge=10.0)
_RIDGE_WHOLE: Final = 1.0
_STEPS: Final = 12
_TAIL: Final = 0.002  # of what was seen is longer than what counts as learnt
_LEAST_SD: Final = (0.2, 0.1)  # sites differ at least so much in level and slope
_BINS: Final = 10


@dataclass(frozen=True, slots=True)
class Task:
    """One model's lessons: ``x`` ``(n, k)``, ``right`` and ``count`` ``(n,)``, and the ``fold`` ``(n,)`` of each."""

    x: Floats
    right: Floats
    count: Floats
    fold: NDArray[np.str_]
    real: NDArray[np.bool_]

    def without(self, fold: str) -> Task:
        """Return the lessons of all other folds."""
        kept = self.fold != fold
        return Task(self.x[kept], self.right[kept], self.count[kept], self.fold[kept], self.real[kept])


def fit_prior(data: Path, seeds: Sequence[int], pieces: int, out: Path) -> Iterator[Row]:
    """Collect outcomes, yield figures of places left out, and write the tables fitted to all as Python modules."""
    found = cases(data, seeds, pieces)
    places = sorted({each.place for each in found if each.real})
    holes = _hole_task(found, tried(found))
    others = {fold: grow_on(holes.without(fold), _HOLES) for fold in np.unique(holes.fold).tolist()}
    yield _figures("candidates", holes, left_out(holes, others))
    chosen = {fold: planted(table(grown, FEATURES), FEATURES) for fold, grown in others.items()}
    fillings = filled(found, {each.fold: chosen[each.fold] for each in found})
    fills = _fills(fillings)
    cells = _cell_task(found, fillings, fills)
    told = left_out(cells, {fold: grow_on(cells.without(fold), _CELLS) for fold in np.unique(cells.fold).tolist()})
    yield _figures("cells", cells, told)
    fallen = _fallen(told, fills, np.concatenate([each.away for each in fillings]))
    yield _figures("cells, falling", cells, fallen)
    whole = _whole_task(cells, fills, fallen)
    spread = site_covariance(cells, fallen)
    yield {
        "model": "sites differ",
        "level_sd": round(spread[0, 0] ** 0.5, 3),
        "slope_sd": round(spread[1, 1] ** 0.5, 3),
    }
    facts = f"{len(holes.right)} ways to close holes of {len(places)} real maps\n({', '.join(places)})"
    _write(out / "prior_holes.py", facts, grow_on(holes, _HOLES), FEATURES, [])
    longest = float(np.quantile(cells.x[:, DESIGN.index("log gap")], 1.0 - _TAIL))
    more = [
        f"LONGEST: Final = {longest:.4f}",
        '"""Logarithm of the longest gap that was learnt on, in cells."""',
        f"WHOLE: Final = ({', '.join(f'{value:.4f}' for value in fitted(whole))})",
        f"SITE_SD: Final = ({', '.join(f'{value:.4f}' for value in np.sqrt(np.diag(spread)))})",
    ]
    facts = f"{len(cells.right)} filled cells of {len(places)} real maps\n({', '.join(places)})"
    _write(out / "prior_cells.py", facts, grow_on(cells, _CELLS), DESIGN, more)


def grow_on(task: Task, growth: Growth) -> Grown:
    """Grow trees on all lessons of a task."""
    return grow(task.x, task.right, task.count, growth)


def left_out(task: Task, others: dict[str, Grown]) -> Floats:
    """Chances ``(n,)`` of each fold's lessons by a model of all others."""
    told = np.empty(len(task.right))
    for fold, grown in others.items():
        here = task.fold == fold
        told[here] = sigmoid(grown.log_odds(task.x[here]))
    return np.clip(told, LOWEST, HIGHEST)


def fitted(task: Task) -> Floats:
    """Return the weights ``(k,)`` of a logistic model; column 0 is one and has no ridge."""
    ridge = np.full(task.x.shape[1], _RIDGE_WHOLE)
    ridge[0] = 1e-6
    return Logistic(np.zeros(len(ridge)), np.diag(ridge)).taught(task.x, task.right, task.count).weights


def site_covariance(task: Task, told: Floats) -> Floats:
    """Covariance ``(2, 2)`` of level and slope between places: their scatter less what chance alone makes of it."""
    found, noise = [], []
    for fold in np.unique(task.fold[task.real]):
        here = task.fold == fold
        x = np.stack([np.ones(int(here.sum())), log_odds(told[here])], axis=1)
        weights = np.array([0.0, 1.0])
        curvature = np.eye(2)
        for _ in range(_STEPS):
            chance = sigmoid(x @ weights)
            slope = x.T @ (task.count[here] * (task.right[here] - chance)) - (weights - (0.0, 1.0))
            curvature = (x * (task.count[here] * chance * (1.0 - chance))[:, None]).T @ x + np.eye(2)
            weights = weights + np.linalg.solve(curvature, slope)
        found.append(weights - (0.0, 1.0))
        noise.append(np.linalg.inv(curvature))
    scatter = np.mean([np.outer(each, each) for each in found], axis=0) - np.mean(noise, axis=0)
    return np.diag(np.maximum(np.diag(scatter), np.array(_LEAST_SD) ** 2))


def _write(path: Path, facts: str, grown: Grown, names: tuple[str, ...], more: list[str]) -> None:
    """Write trees as a Python module that ``mapping.trees.planted`` reads."""
    trees = table(grown, names)
    lines = [
        '"""Trees of the prior, written by ``lacuna bench holes --fit-prior``: do not edit.',
        "",
        f"Fitted to {facts},",
        "of emulated sites and of drawn floor plans.",
        '"""',
        "",
        "from __future__ import annotations",
        "",
        "from typing import Final",
        "",
        "from mapping.trees import Table",
        "",
        *more,
        "TREES: Final = Table(",
        f'    """{trees.features}""",',
        f'    """{trees.cuts}""",',
        f'    """{trees.trees}""",',
        ")",
        "",
    ]
    replace_file(path, "\n".join(lines).encode())


def _hole_task(found: list[Case], lessons: list[Tried]) -> Task:
    x, right = (np.concatenate([getattr(each, name) for each in lessons]) for name in ("features", "right"))
    sizes = [len(each.right) for each in lessons]
    worth = np.concatenate([each.worth for each in lessons])
    return Task(x, right.astype(np.float64), worth, *_folds(found, sizes))


def _cell_task(found: list[Case], lessons: list[Filling], fills: NDArray[np.int64]) -> Task:
    x, right = (np.concatenate([getattr(each, name) for each in lessons]) for name in ("design", "right"))
    count = 1.0 / np.sqrt(np.bincount(fills)[fills])  # cells of one fill are right or wrong together
    folds = _folds(found, [len(each.right) for each in lessons])
    return Task(x.astype(np.float64), right.astype(np.float64), count, *folds)


def _whole_task(cells: Task, fills: NDArray[np.int64], told: Floats) -> Task:
    starts = np.flatnonzero(np.concatenate([[True], fills[1:] != fills[:-1]]))
    parts = np.split(np.arange(len(fills)), starts[1:])
    x = whole_features([told[part].astype(np.float32) for part in parts])
    right = np.array([cells.right[part].all() for part in parts], np.float64)
    return Task(x, right, np.ones(len(right)), cells.fold[starts], cells.real[starts])


def _folds(found: list[Case], sizes: list[int]) -> tuple[NDArray[np.str_], NDArray[np.bool_]]:
    return np.repeat([each.fold for each in found], sizes), np.repeat([each.real for each in found], sizes)


def _fills(lessons: list[Filling]) -> NDArray[np.int64]:
    """Return the number of the fill of each cell ``(m,)`` over all cases."""
    pairs = [np.stack([np.full(len(each.fill), index), each.fill], axis=1) for index, each in enumerate(lessons)]
    return np.asarray(np.unique(np.concatenate(pairs), axis=0, return_inverse=True)[1], np.int64).ravel()


def _fallen(told: Floats, fills: NDArray[np.int64], away: Floats) -> Floats:
    fallen = told.copy()
    for fill in np.unique(fills):
        here = fills == fill
        fallen[here] = falling(told[here], away[here])
    return fallen


def _figures(name: str, task: Task, told: Floats) -> Row:
    row: Row = {"model": name, "lessons": len(told), "right": round(float(task.right.mean()), 3)}
    for group, here in (("maps", task.real), ("sites", ~task.real)):
        if here.any():
            chance, right = told[here], task.right[here]
            parts = np.array_split(np.argsort(chance, kind="stable"), _BINS)
            spread = float(np.mean((right.mean() - right) ** 2))
            row[f"{group}_skill"] = round(1.0 - float(np.mean((chance - right) ** 2)) / max(spread, 1e-9), 3)
            off = [len(part) * abs(float(chance[part].mean() - right[part].mean())) for part in parts if len(part)]
            row[f"{group}_ece"] = round(sum(off) / len(right), 3)
            row[f"{group}_auc"] = round(_area(chance, right), 3)
    return row


def _area(chance: Floats, right: Floats) -> float:
    """Area under the curve: how often a right one is told surer than a wrong one."""
    _, inverse, count = np.unique(chance, return_inverse=True, return_counts=True)
    rank: Floats = (np.cumsum(count) - (count - 1) / 2.0)[inverse]
    good = float(np.sum(right))
    bad = len(right) - good
    summed = float(np.sum(rank[right > 0]))
    return (summed - good * (good + 1.0) / 2.0) / max(good * bad, 1.0)
