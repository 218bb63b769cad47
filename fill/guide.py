"""Where to station next: places from which most of what is still open would be seen.

Plain and greedy, as in stop-and-scan laser surveying (Gonzalez-Banos and Latombe 2002): a place counts the edge of
unseen water and the doubtful fills in its view; the best is taken, what it sees is struck off, and so on.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from fill.segments import EIGHT
from fill.values import Filled
from mapping.values import FREE, OCCUPIED, UNKNOWN

_GOALS: Final = 3
_CLEARANCE_M: Final = 0.25
_GRAIN_M: Final = 0.4  # between places that are compared
_VIEW_M: Final = 3.0
_STEP_M: Final = 3.0  # further from every station a scan may not be placed
_APART_M: Final = 0.8  # nearer to a station little is new
_DOUBT: Final = 0.5
_DOUBT_WORTH_M: Final = 0.5
_LEAST_M: Final = 0.3
_EDGE_CELLS: Final = 3  # shorter edges are noise


@dataclass(frozen=True, slots=True)
class Goal:
    """A place to station next, from where ``edge_m`` of unseen edge and ``doubtful`` fills come into view."""

    x_m: float
    y_m: float
    edge_m: float
    doubtful: int
    why: str


@dataclass(frozen=True, slots=True)
class _Targets:
    """Places in cells ``(n, 2)`` row and column, worth ``(n,)`` m each; the last ``doubtful`` of them are fills."""

    cells: NDArray[np.float64]
    worth: NDArray[np.float64]
    doubtful: NDArray[np.bool_]


def guide(filled: Filled, stations_m: Mapping[int, tuple[float, float]]) -> tuple[Goal, ...]:
    """Name up to three places to station next, best first; ``stations_m`` are x and y of the placed stations.

    Nothing is named where nothing is open: then the map is as complete as the sonar can make it.
    """
    places = _places(filled, stations_m)
    targets = _targets(filled)
    if not len(places) or not len(targets.cells):
        return ()
    views = _views(places, targets, filled)
    goals: list[Goal] = []
    left = np.ones(len(targets.cells), bool)
    while len(goals) < _GOALS:
        gains = (views & left) @ targets.worth
        best = int(np.argmax(gains))
        if gains[best] < _LEAST_M:
            break
        goals.append(_goal(places[best], views[best] & left, targets, filled, stations_m))
        left &= ~views[best]
    return tuple(goals)


def _places(filled: Filled, stations_m: Mapping[int, tuple[float, float]]) -> NDArray[np.int64]:
    """Free cells ``(n, 2)`` with room for the vehicle, in steps of the grain, that a pilot can reach and scan from."""
    grid = filled.grid
    free = grid.state == FREE
    roomy = ndimage.distance_transform_edt(np.pad(free, 1))[1:-1, 1:-1] * grid.cell_m >= _CLEARANCE_M
    grain = max(1, round(_GRAIN_M / grid.cell_m))
    lattice = np.zeros(free.shape, bool)
    lattice[grain // 2 :: grain, grain // 2 :: grain] = True
    if not stations_m:
        return np.argwhere(roomy & lattice)
    stations = np.array([stations_m[number] for number in sorted(stations_m)])
    cells = np.floor((stations[:, ::-1] - (grid.y0_m, grid.x0_m)) / grid.cell_m).astype(np.int64)
    places = np.argwhere(roomy & lattice & _waters_of(cells, free))
    away_m = np.hypot(*(places[:, None] - cells[None]).transpose(2, 0, 1)).min(axis=1) * grid.cell_m
    return np.asarray(places[(away_m >= _APART_M) & (away_m <= _STEP_M)], np.int64)


def _waters_of(cells: NDArray[np.int64], free: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Free water that hangs together with the cell of a station."""
    waters, _ = ndimage.label(free)
    inside = np.all((cells >= 0) & (cells < free.shape), axis=1)
    ours = np.unique(waters[tuple(cells[inside].T)])
    return np.isin(waters, ours[ours > 0])


def _targets(filled: Filled) -> _Targets:
    state = np.where(filled.hole >= 0, OCCUPIED, filled.grid.state)
    unseen = ndimage.binary_dilation(state == UNKNOWN)
    edges, count = ndimage.label((state == FREE) & unseen, EIGHT)
    long_enough = np.bincount(edges.ravel(), minlength=count + 1) >= _EDGE_CELLS
    long_enough[0] = False
    edge = np.argwhere(long_enough[edges])
    doubts = [hole.cells.mean(axis=0) for hole in filled.holes if hole.hole_certainty < _DOUBT]
    cells = np.concatenate([edge, np.array(doubts).reshape(-1, 2)]).astype(np.float64)
    doubtful = np.arange(len(cells)) >= len(edge)
    return _Targets(cells, np.where(doubtful, _DOUBT_WORTH_M, filled.grid.cell_m), doubtful)


def _views(places: NDArray[np.int64], targets: _Targets, filled: Filled) -> NDArray[np.bool_]:
    """Which targets ``(n_places, n_targets)`` are in range with nothing but free water between."""
    grid = filled.grid
    share = np.linspace(0.0, 0.9, 24)[:, None]
    views = np.zeros((len(places), len(targets.cells)), bool)
    for index, place in enumerate(places):
        apart = targets.cells - place
        near = np.flatnonzero(np.hypot(apart[:, 0], apart[:, 1]) * grid.cell_m <= _VIEW_M)
        rows = np.rint(place[0] + share * apart[near, 0]).astype(np.int64)
        cols = np.rint(place[1] + share * apart[near, 1]).astype(np.int64)
        views[index, near] = np.all(grid.state[rows, cols] == FREE, axis=0)
    return views


def _goal(
    place: NDArray[np.int64], seen: NDArray[np.bool_], targets: _Targets, filled: Filled,
    stations_m: Mapping[int, tuple[float, float]],
) -> Goal:  # fmt: skip
    grid = filled.grid
    x_m, y_m = grid.x0_m + (place[1] + 0.5) * grid.cell_m, grid.y0_m + (place[0] + 0.5) * grid.cell_m
    edge_m = float(targets.worth[seen & ~targets.doubtful].sum())
    doubtful = int(np.count_nonzero(seen & targets.doubtful))
    parts = [f"{edge_m:.1f} m of unseen edge"] if edge_m > 0 else []
    if doubtful:
        parts.append(f"{doubtful} doubtful fill{'s' if doubtful > 1 else ''}")
    why = "opens " + " and ".join(parts)
    if stations_m:
        away = {number: float(np.hypot(x - x_m, y - y_m)) for number, (x, y) in sorted(stations_m.items())}
        nearest = min(away, key=lambda number: away[number])
        why += f", {away[nearest]:.1f} m from station {nearest}"
    return Goal(float(x_m), float(y_m), edge_m, doubtful, why)
