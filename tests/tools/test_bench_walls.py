"""Walls of a map held against walls that lean."""

from __future__ import annotations

import numpy as np
import pytest

from mapping.values import OCCUPIED, UNKNOWN, Grid
from tools.bench.align import Alignment
from tools.bench.leaning import Plan, WallFigures, judge_walls, plans_of
from tools.emulator.echoes import Place
from tools.emulator.site import Site, Wall
from tools.emulator.site.shapes import rectangle

SAME = Alignment(0.0, np.zeros(2))
TAPER = 0.2


def well(taper_per_m: float = TAPER) -> Site:
    wall = Wall(np.array(rectangle(-2.0, -2.0, 2.0, 2.0)))
    return Site("well", (wall,), floor_m=4.0, stops=(), taper_per_m=taper_per_m, plan_depth_m=1.0)


def at(depth_m: float, x_m: float = 0.3) -> Place:
    return Place(x_m, -0.2, depth_m, 0.0)


def square(half_m: float, sides: int = 4) -> Grid:
    """The first sides of a square about the origin, as a map of 5-cm cells has them."""
    state = np.full((140, 140), UNKNOWN, np.uint8)
    low, high = (round((3.5 + way * half_m) / 0.05) for way in (-1, 1))
    edges = (np.s_[low, low:high], np.s_[high - 1, low:high], np.s_[low:high, low], np.s_[low:high, high - 1])
    for edge in edges[:sides]:
        state[edge] = OCCUPIED
    return Grid(0.05, -3.5, -3.5, np.zeros(state.shape, np.float32), state)


def judged(grids: list[Grid], placed: list[list[Place]], lost: list[Place], site: Site) -> WallFigures:
    return judge_walls(site, plans_of(grids, placed, lost), SAME, 10.0, 1.5)


def test_each_level_is_held_against_the_wall_at_its_own_depth() -> None:
    both = judged([square(2.0), square(2.8)], [[at(1.0)], [at(3.0)]], [], well())
    assert both.precision == 1.0
    assert both.recall == 1.0
    assert judged([square(2.0)], [[at(1.0), at(3.0)]], [], well(0.0)).recall == 1.0
    swapped = judged([square(2.8), square(2.0)], [[at(1.0)], [at(3.0)]], [], well())
    assert swapped.precision == swapped.recall == 0.0


def test_a_wall_that_was_seen_at_two_depths_is_right_at_either_and_nowhere_else() -> None:
    places = [[at(1.0), at(1.5)]]
    assert judged([square(2.0)], places, [], well()).precision == 1.0
    assert judged([square(2.2)], places, [], well()).recall == 1.0
    assert judged([square(2.4)], places, [], well()).precision == 0.0


def test_what_scans_without_a_place_had_in_view_is_missing() -> None:
    near = judged([square(2.0, sides=2)], [[at(1.0)]], [at(1.1)], well())
    assert near.recall == pytest.approx(0.5, abs=0.06)
    deep = judged([square(2.0)], [[at(1.0)]], [at(3.0)], well())
    assert deep.precision == 1.0
    assert deep.recall == pytest.approx(0.5, abs=0.01)
    assert plans_of([], [], [at(3.0)]) == [Plan(None, (at(3.0),))]


def test_a_level_without_places_has_no_right_cells() -> None:
    told = judged([square(2.0), square(2.8)], [[at(1.0)], []], [], well())
    assert told.cells > told.right > 0
    assert told.recall == 1.0
