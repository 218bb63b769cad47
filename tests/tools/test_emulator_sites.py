"""Emulated sites: closed walls, and dives that stay clear of them."""

from __future__ import annotations

from itertools import pairwise
from math import radians

import numpy as np
import pytest

from tests.tools.plans import Floats, clearance_m, edges, in_water
from tools.emulator.fan import View
from tools.emulator.rays import NOTHING_M, Segments, cast, trace
from tools.emulator.scene import Scene
from tools.emulator.site import ROCK, SITES, Site, Wall, rectangle
from tools.emulator.site.curves import beside, smooth

LONGEST_STEP_M = 3.0
CLEAR_M = 0.4
CLEAR_BETWEEN_M = 0.3
SIZES = {  # what each is said to be: width, height, least number of stops
    "bell": (5.5, 5.5, 14),
    "cave": (10.0, 9.0, 8),
    "gallery": (43.0, 10.0, 20),
    "hall": (20.0, 8.0, 15),
    "house": (5.2, 4.1, 5),
    "keyhole": (9.7, 5.3, 8),
    "loop": (16.5, 9.5, 12),
    "pool": (8.0, 5.0, 4),
    "tunnel": (44.0, 1.8, 8),
}


def legs(site: Site) -> list[tuple[float, float, Floats]]:
    """Each way between stops: both depths, and points along it a few centimetres apart."""
    found = []
    for stop, after in pairwise(site.stops):
        path = np.array([(stop.x_m, stop.y_m), *after.via_m, (after.x_m, after.y_m)])
        way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
        at = np.linspace(0.0, way[-1], 100)
        points = np.stack([np.interp(at, way, path[:, 0]), np.interp(at, way, path[:, 1])], axis=1)
        assert way[-1] <= LONGEST_STEP_M
        found.append((stop.depth_m, after.depth_m, points))
    return found


def test_there_are_nine_sites_named_as_they_are_asked_for() -> None:
    assert sorted(SITES) == sorted(SIZES)
    assert all(make().name == name for name, make in SITES.items())


@pytest.mark.parametrize("name", sorted(SITES))
def test_stops_lie_in_open_water_and_see_walls(name: str) -> None:
    site = SITES[name]()
    for stop in site.stops:
        walls = site.plan_at(stop.depth_m)
        here = np.array([[stop.x_m, stop.y_m]])
        assert in_water(walls, here)
        assert clearance_m(walls, here)[0] >= CLEAR_M
        assert site.ceiling_m + 0.3 <= stop.depth_m <= site.floor_m - 0.3
        ways = trace(Segments.of(walls), here[0], np.radians(np.arange(0.0, 360.0, 2.0)), 0)[0].way_m
        assert ways.max() < NOTHING_M, "closed all around"
        assert (ways < 9.0).mean() > 0.5


@pytest.mark.parametrize("name", sorted(SITES))
def test_ways_between_stops_are_short_and_clear(name: str) -> None:
    site = SITES[name]()
    for from_m, to_m, points in legs(site):
        for depth_m in (from_m, to_m):
            walls = site.plan_at(depth_m)
            assert in_water(walls, points)
            assert clearance_m(walls, points).min() >= CLEAR_BETWEEN_M


@pytest.mark.parametrize("name", sorted(SITES))
def test_walls_are_closed_and_cross_neither_themselves_nor_each_other(name: str) -> None:
    site = SITES[name]()
    assert all(wall.closed for wall in site.walls)
    start, end = edges(site.walls)
    along = end - start
    length = np.linalg.norm(along, axis=1)
    hits = cast(Segments.of(site.walls), start + 1e-4 * along, along / length[:, None])
    assert (hits.way_m >= length * (1.0 - 3e-4)).all()


@pytest.mark.parametrize("name", sorted(SITES))
def test_sites_have_the_size_they_are_said_to_have_and_are_always_the_same(name: str) -> None:
    site, again = SITES[name](), SITES[name]()
    size = np.ptp(np.concatenate([wall.points_m for wall in site.walls]), axis=0)
    width_m, height_m, stops = SIZES[name]
    assert size == pytest.approx([width_m, height_m], rel=0.06)
    assert stops <= len(site.stops) <= 25
    assert site.stops == again.stops
    assert all(np.array_equal(a.points_m, b.points_m) for a, b in zip(site.walls, again.walls, strict=True))


@pytest.mark.parametrize("name", ["bell", "cave", "hall", "house", "loop"])
def test_dives_come_back_to_where_they_were(name: str) -> None:
    stops = [np.array([stop.x_m, stop.y_m]) for stop in SITES[name]().stops]
    gaps = [np.linalg.norm(a - b) for i, a in enumerate(stops) for b in stops[i + 3 :]]
    assert min(gaps) < 1.5


def test_the_tunnel_tells_nothing_of_its_ends() -> None:
    site = SITES["tunnel"]()
    ends_m = [22.0 - abs(stop.x_m) for stop in site.stops]
    assert min(ends_m) > 10.0
    scene = Scene(site, 1)
    west, east = (scene.power(View(x, 0.0, 1.3, 0.025, 400), radians(90.0)) for x in (-6.0, 6.0))
    assert 10 * np.log10(west[240:].max() + 1e-9) == pytest.approx(10 * np.log10(east[240:].max() + 1e-9), abs=6.0)


def test_a_flooded_ceiling_answers_like_a_floor() -> None:
    walls = (Wall(np.array(rectangle(-30, -30, 30, 30))),)
    levels = []
    for ceiling_m in (0.0, 1.0):
        site = Site("wide", walls, floor_m=61.0 + ceiling_m, stops=(), material=ROCK, ceiling_m=ceiling_m)
        power = Scene(site, 1).power(View(0.0, 0.0, ceiling_m + 0.6, 0.025, 400), 0.3)
        levels.append(10 * np.log10(power[:200].max()))
    assert levels[1] - levels[0] == pytest.approx(14.0, abs=0.5)


def test_a_smooth_course_passes_its_points_and_has_its_right_on_the_right() -> None:
    through = [(0.0, 0.0), (4.0, 1.0), (8.0, 0.0)]
    course = smooth(through, closed=False)
    for point in through:
        assert np.linalg.norm(course.points_m - point, axis=1).min() < 1e-9
    assert (course.right @ np.array([0.0, 1.0]) < 0.0).all(), "eastwards, south is right"
    apart = np.linalg.norm(beside(course, np.full(len(course.points_m), 0.5)) - course.points_m, axis=1)
    assert apart == pytest.approx(0.5)
    x_m, y_m, course_deg = course.at(0.0, 0.0)
    assert (x_m, y_m) == pytest.approx((0.0, 0.0))
    assert course_deg == pytest.approx(76.0, abs=1.0)
    ring = smooth([(0.0, 2.0), (2.0, 0.0), (0.0, -2.0), (-2.0, 0.0)], closed=True)
    assert (np.linalg.norm(beside(ring, np.full(len(ring.points_m), 0.3)), axis=1) < 2.0).all(), "clockwise: inwards"
