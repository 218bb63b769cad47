"""A map's plans held against walls that may lean: each level's against the wall as it stood where it was seen from.

A wall that leans stands elsewhere at every depth, and each scan sees it at its own.  So a wall cell is right where it
lies on the wall at the depth of a scan of its level, and a stretch of wall that was in view is found where a cell lies
on it at the depth of a scan that had it in view.  Scans that found no place count too: what they had in view at their
depth is missing, unless another scan of that level shows it.  Where walls are upright, all this is one plan.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from mapping.pieces import LEVEL_M
from mapping.values import OCCUPIED, Grid
from tools.bench.align import Alignment
from tools.bench.walls import Line, distance_to_walls_m, in_view, sampled
from tools.emulator.echoes import Place
from tools.emulator.site import Wall

DEPTH_M: Final = 0.05
"""Walls are drawn at depths of so many metres apart."""

Floats = NDArray[np.float64]


class Walled(Protocol):
    """A place of which it is known how its walls stand at each depth."""

    @property
    def walls(self) -> tuple[Wall, ...]:
        """Walls at the depth at which they are told."""
        ...

    def stand(self, walls: tuple[Wall, ...], depth_m: float) -> tuple[Wall, ...]:
        """Return walls, told at that depth, as they stand at another."""
        ...


@dataclass(frozen=True, slots=True)
class Plan:
    """One level: its grid, None where the map has none, and where the vehicle rested at it."""

    grid: Grid | None
    places: tuple[Place, ...]


@dataclass(frozen=True, slots=True)
class WallFigures:
    """Wall cells, how many of them are right; points of wall that were in view, how many of them were found."""

    cells: int
    right: int
    seen: int
    found: int

    @property
    def precision(self) -> float:
        """Share of the wall cells that are right, 0 where there is none."""
        return self.right / self.cells if self.cells else 0.0

    @property
    def recall(self) -> float:
        """Share of the wall in view that was found, 0 where none was in view."""
        return self.found / self.seen if self.seen else 0.0


def plans_of(grids: Sequence[Grid], placed: Sequence[Sequence[Place]], lost: Sequence[Place]) -> list[Plan]:
    """Give each grid the places of its stations, and what found no place to the plan of its depth, or to none."""
    places = [list(each) for each in placed]
    alone: list[Plan] = []
    depths_m = [float(np.median([place.depth_m for place in each])) if each else np.inf for each in placed]
    for place in lost:
        off_m = np.abs(np.array(depths_m) - place.depth_m)
        if len(off_m) and off_m.min() <= LEVEL_M:
            places[int(off_m.argmin())].append(place)
        else:
            alone.append(Plan(None, (place,)))
    return [Plan(grid, tuple(each)) for grid, each in zip(grids, places, strict=True)] + alone


def judge_walls(
    site: Walled, plans: Sequence[Plan], alignment: Alignment, range_m: float, within_cells: float
) -> WallFigures:
    """Judge all plans of a map together; a cell is right no farther than ``within_cells`` from true wall."""
    each = [_judge(site, plan, alignment, range_m, within_cells) for plan in plans]
    return WallFigures(*(int(total) for total in np.sum([np.array(one) for one in each], axis=0)))


def _judge(
    site: Walled, plan: Plan, alignment: Alignment, range_m: float, within_cells: float
) -> tuple[int, int, int, int]:
    cells_m, within_m = np.zeros((0, 2)), 0.0
    if plan.grid is not None:
        cells_m, within_m = alignment.apply(_walls_of(plan.grid)), within_cells * plan.grid.cell_m
    tree = cKDTree(cells_m) if len(cells_m) else None
    samples = Wall(sampled(_lines(site.walls)), closed=False)
    right = np.zeros(len(cells_m), dtype=bool)
    seen, found = (np.zeros(len(samples.points_m), dtype=bool) for _ in range(2))
    for depth_m, places in _by_depth(plan.places).items():
        lines = _lines(site.stand(site.walls, depth_m))
        (points_m,) = (wall.points_m for wall in site.stand((samples,), depth_m))
        right |= distance_to_walls_m(cells_m, lines) <= within_m
        here = np.any([in_view(points_m, lines, np.array([p.x_m, p.y_m]), range_m) for p in places], axis=0)
        seen |= here
        if tree is not None:
            found |= here & (np.asarray(tree.query(points_m)[0]) <= within_m)
    return len(cells_m), int(right.sum()), int(seen.sum()), int(found.sum())


def _by_depth(places: Sequence[Place]) -> dict[float, list[Place]]:
    depths: dict[float, list[Place]] = {}
    for place in places:
        depths.setdefault(round(place.depth_m / DEPTH_M) * DEPTH_M, []).append(place)
    return depths


def _lines(walls: Sequence[Wall]) -> list[Line]:
    return [(wall.points_m, wall.closed) for wall in walls]


def _walls_of(grid: Grid) -> Floats:
    rows, cols = np.nonzero(grid.state == OCCUPIED)
    return np.stack([grid.x0_m + (cols + 0.5) * grid.cell_m, grid.y0_m + (rows + 0.5) * grid.cell_m], axis=1)
