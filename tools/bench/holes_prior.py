"""Fitting the prior of certainties to what became of fills in damaged maps: ``lacuna bench holes --fit-prior FILE``.

Each model is judged on places that it did not see: one map or site is left out at a time (several pieces and seeds of
it together), and the figures are over all of them.  What is written is fitted to all.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fill.candidates import FEATURES
from fill.certainty import DESIGN, HIGHEST, LOWEST, falling, log_odds, whole_features
from fill.logistic import Logistic, sigmoid
from fill.prior import prior
from tools.bench.holes_outcomes import Case, Filling, Tried, cases, filled, tried
from tools.files import replace_file

Row = dict[str, str | int | float]
Floats = NDArray[np.float64]

_RIDGE_CELLS: Final = 10.0
_RIDGE_HOLES: Final = 5.0
_STEPS: Final = 12
_TAIL: Final = 0.002  # of what was seen lies beyond either edge of the learnt range
_LEAST_SD: Final = (0.2, 0.1)  # sites differ at least so much in level and slope
_BINS: Final = 10


@dataclass(frozen=True, slots=True)
class Task:
    """One model's lessons: ``x`` ``(n, k)``, ``right`` and ``count`` ``(n,)``, and the ``place`` ``(n,)`` of each."""

    x: Floats
    right: Floats
    count: Floats
    place: NDArray[np.str_]
    real: NDArray[np.bool_]
    ridge: float


@dataclass(frozen=True, slots=True)
class Tables:
    """What is written: weights, ranges, and how much sites differ."""

    hole: Floats
    cell: Floats
    low: Floats
    high: Floats
    site_covariance: Floats
    whole: Floats


def fit_prior(data: Path, seeds: Sequence[int], pieces: int, out: Path, keep: bool = False) -> Iterator[Row]:
    """Collect outcomes, yield figures of places left out, and write the tables fitted to all as a Python module.

    With ``keep`` the weights of candidates stay as they are, and only certainties are fitted, to what those close.
    """
    found = cases(data, seeds, pieces)
    weights, facts = prior().hole.weights, "kept candidates"
    if not keep:
        holes = _hole_task(found, tried(found))
        yield _figures("candidates", holes, left_out(holes))
        weights, facts = fitted(holes), f"{len(holes.right)} candidates"
    fillings = filled(found, Logistic(weights, np.eye(len(weights))))
    fills = _fills(fillings)
    cells = _cell_task(found, fillings, fills)
    told = left_out(cells)
    yield _figures("cells", cells, told)
    fallen = _fallen(told, fills, np.concatenate([each.away for each in fillings]))
    yield _figures("cells, falling", cells, fallen)
    whole = _whole_task(cells, fills, fallen)
    yield _figures("whole fills", whole, left_out(whole))
    spread = site_covariance(cells, told)
    yield {
        "model": "sites differ",
        "level_sd": round(spread[0, 0] ** 0.5, 3),
        "slope_sd": round(spread[1, 1] ** 0.5, 3),
    }
    low, high = np.quantile(cells.x, [_TAIL, 1.0 - _TAIL], axis=0)
    tables = Tables(weights, fitted(cells), low, high, spread, fitted(whole))
    facts += f" and {len(cells.right)} filled cells"
    replace_file(out, module(tables, facts, sorted({each.place for each in found if each.real})).encode())


def fitted(task: Task) -> Floats:
    """Return the weights ``(k,)`` of a logistic model with a ridge on its standardised features; column 0 is one."""
    middle, scale = task.x.mean(axis=0), task.x.std(axis=0)
    middle[0], scale[0] = 0.0, 1.0
    live = scale > 1e-9
    x = np.where(live, (task.x - middle) / np.where(live, scale, 1.0), 0.0)
    ridge = np.full(x.shape[1], task.ridge)
    ridge[0] = 1e-6
    weights = np.zeros(x.shape[1])
    for _ in range(_STEPS):
        chance = sigmoid(x @ weights)
        slope = x.T @ (task.count * (task.right - chance)) - ridge * weights
        curvature = (x * (task.count * chance * (1.0 - chance))[:, None]).T @ x + np.diag(ridge)
        weights += np.linalg.solve(curvature, slope)
    raw = np.where(live, weights / np.where(live, scale, 1.0), 0.0)
    raw[0] -= float(raw[1:] @ middle[1:])
    return raw


def left_out(task: Task) -> Floats:
    """Chances ``(n,)`` of each place's lessons by a model of all others."""
    told = np.empty(len(task.right))
    for place in np.unique(task.place):
        here = task.place == place
        others = dataclasses.replace(task, x=task.x[~here], right=task.right[~here], count=task.count[~here])
        low, high = np.quantile(others.x, [_TAIL, 1.0 - _TAIL], axis=0)
        told[here] = sigmoid(np.clip(task.x[here], low, high) @ fitted(others))
    return np.clip(told, LOWEST, HIGHEST)


def site_covariance(task: Task, told: Floats) -> Floats:
    """Covariance ``(2, 2)`` of level and slope between places: their scatter less what chance alone makes of it."""
    found, noise = [], []
    for place in np.unique(task.place[task.real]):
        here = task.place == place
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


def module(tables: Tables, facts: str, places: Sequence[str]) -> str:
    """Return the tables as the text of a Python module."""
    lines = [
        '"""Weights of the prior, written by ``lacuna bench holes --fit-prior``: do not edit.',
        "",
        f"Fitted to {facts} of {len(places)} real maps",
        f"({', '.join(places)})",
        "nine emulated sites and drawn floor plans.",
        '"""',
        "",
        "from __future__ import annotations",
        "",
        "from typing import Final",
        "",
        "HOLE: Final = {",
        *(f'    "{name}": {value:.4f},' for name, value in zip(FEATURES, tables.hole, strict=True)),
        "}",
        "CELL: Final = {",
        *(
            f'    "{name}": ({value:.5f}, {low:.4f}, {high:.4f}),'
            for name, value, low, high in zip(DESIGN, tables.cell, tables.low, tables.high, strict=True)
        ),
        "}",
        '"""Weight, and the range in which it was learnt."""',
        f"WHOLE: Final = ({', '.join(f'{value:.4f}' for value in tables.whole)})",
        f"SITE_SD: Final = ({', '.join(f'{value:.4f}' for value in np.sqrt(np.diag(tables.site_covariance)))})",
        "",
    ]
    return "\n".join(lines)


def _hole_task(found: list[Case], lessons: list[Tried]) -> Task:
    x, right = (np.concatenate([getattr(each, name) for each in lessons]) for name in ("features", "right"))
    sizes = [len(each.right) for each in lessons]
    worth = np.concatenate([each.worth for each in lessons])
    return Task(x, right.astype(np.float64), worth, *_places(found, sizes), _RIDGE_HOLES)


def _cell_task(found: list[Case], lessons: list[Filling], fills: NDArray[np.int64]) -> Task:
    x, right = (np.concatenate([getattr(each, name) for each in lessons]) for name in ("design", "right"))
    count = 1.0 / np.sqrt(np.bincount(fills)[fills])  # cells of one fill are right or wrong together
    places = _places(found, [len(each.right) for each in lessons])
    return Task(x.astype(np.float64), right.astype(np.float64), count, *places, _RIDGE_CELLS)


def _whole_task(cells: Task, fills: NDArray[np.int64], told: Floats) -> Task:
    starts = np.flatnonzero(np.concatenate([[True], fills[1:] != fills[:-1]]))
    parts = np.split(np.arange(len(fills)), starts[1:])
    x = whole_features([told[part].astype(np.float32) for part in parts])
    right = np.array([cells.right[part].all() for part in parts], np.float64)
    return Task(x, right, np.ones(len(right)), cells.place[starts], cells.real[starts], 1.0)


def _places(found: list[Case], sizes: list[int]) -> tuple[NDArray[np.str_], NDArray[np.bool_]]:
    return np.repeat([each.place for each in found], sizes), np.repeat([each.real for each in found], sizes)


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
