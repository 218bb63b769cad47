"""Emulated sites: walls in plan, floor, water surface, and the stops of a dive.

Frame: x east, y north, z down from the water surface; headings clockwise from north.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import hypot, radians
from typing import Final

import numpy as np
from numpy.typing import NDArray

Points = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Material:
    """How a wall answers.

    ``backscatter_db`` beside the walls of a tiled tank, ``mirror_db`` gained (less than none) at a mirror-like bounce,
    one way; ``corner_db`` of a re-entrant corner beside a wall at normal incidence; ``texture_db`` the standard
    deviation from spot to spot.
    """

    backscatter_db: float
    mirror_db: float
    corner_db: float
    texture_db: float


TILE: Final = Material(backscatter_db=0.0, mirror_db=-5.0, corner_db=8.0, texture_db=3.5)
ROCK: Final = Material(backscatter_db=0.0, mirror_db=-6.5, corner_db=2.0, texture_db=4.5)


@dataclass(frozen=True, slots=True)
class Wall:
    """A polyline in plan, ``points_m`` ``(n, 2)`` float64; ``closed`` joins the last point to the first."""

    points_m: Points
    closed: bool = True


@dataclass(frozen=True, slots=True)
class Stop:
    """Where the vehicle rests, and what it passes on the way there (``via_m``, in plan)."""

    x_m: float
    y_m: float
    depth_m: float
    heading_rad: float
    via_m: tuple[tuple[float, float], ...] = ()


@dataclass(frozen=True, slots=True)
class Site:
    """A flooded place.

    ``walls`` is the plan at depth ``plan_depth_m``; at other depths it is scaled about ``centre_m`` by
    ``1 + taper_per_m * (depth - plan_depth_m)``, so that a bell widens downwards with a positive taper.
    """

    name: str
    walls: tuple[Wall, ...]
    floor_m: float
    stops: tuple[Stop, ...]
    material: Material = ROCK
    taper_per_m: float = 0.0
    plan_depth_m: float = 1.3
    centre_m: tuple[float, float] = (0.0, 0.0)

    def plan_at(self, depth_m: float) -> tuple[Wall, ...]:
        """Return the walls as they stand at a depth."""
        scale = 1.0 + self.taper_per_m * (depth_m - self.plan_depth_m)
        centre = np.array(self.centre_m)
        return tuple(Wall(centre + scale * (wall.points_m - centre), wall.closed) for wall in self.walls)


def rock_cut(
    outline: list[tuple[float, float]], rng: np.random.Generator, facet_m: float = 0.22, roughness_m: float = 0.035
) -> Wall:
    """Cut a closed outline into facets and move them by correlated noise along the wall's normal.

    ``roughness_m`` is the standard deviation of the wall about its outline; neighbouring facets move together.
    """
    points = _resample(np.array(outline, dtype=np.float64), facet_m)
    noise = rng.normal(size=len(points))
    smooth = np.fft.ifft(np.fft.fft(noise) * np.exp(-((np.fft.fftfreq(len(points)) * 5.0) ** 2))).real
    smooth *= roughness_m / smooth.std()
    along = np.roll(points, -1, axis=0) - np.roll(points, 1, axis=0)
    normal = np.stack([along[:, 1], -along[:, 0]], axis=1) / np.linalg.norm(along, axis=1)[:, None]
    return Wall(points + smooth[:, None] * normal)


def _resample(outline: Points, facet_m: float) -> Points:
    """Keep every corner of a closed outline and put points between them, at most ``facet_m`` apart."""
    pieces = []
    for start, end in zip(outline, np.roll(outline, -1, axis=0), strict=True):
        count = max(1, int(np.ceil(hypot(*(end - start)) / facet_m)))
        pieces.append(start + (end - start) * (np.arange(count) / count)[:, None])
    return np.concatenate(pieces)


def oval(
    centre: tuple[float, float], width_m: float, depth_m: float, start_deg: float = 0.0, end_deg: float = 360.0
) -> list[tuple[float, float]]:
    """Points of an ellipse, clockwise from ``start_deg`` to ``end_deg`` (from north), both ends included."""
    angles = np.radians(np.arange(start_deg, end_deg + 1e-9, 5.0))
    return [(centre[0] + width_m / 2 * np.sin(a), centre[1] + depth_m / 2 * np.cos(a)) for a in angles]


def rectangle(x0: float, y0: float, x1: float, y1: float) -> list[tuple[float, float]]:
    """Corners of an upright rectangle."""
    return [(x0, y0), (x0, y1), (x1, y1), (x1, y0)]


def keyhole() -> Site:
    """Return a rock-cut cistern: an oval chamber and a straight passage that leaves it to the east.

    In character the keyhole cistern of the paper (150 x 100 cells of about 7 cm, 2.6 m of water).
    """
    half, mouth_deg = 0.75, 16.0
    chamber = oval((0.0, 0.0), 5.8, 5.3, 90.0 + mouth_deg, 450.0 - mouth_deg)
    passage = [(2.75, half), (6.7, half + 0.1), (6.75, -half), (2.75, -half)]
    wall = rock_cut(chamber + passage, np.random.default_rng(2011))
    stops = (
        _stop(-1.1, -1.1, 350.0),
        _stop(-0.9, 0.3, 20.0),
        _stop(0.5, 1.2, 75.0),
        _stop(0.6, -0.9, 130.0, depth_m=1.4),
        _stop(1.9, 0.1, 95.0, depth_m=1.4),
        _stop(3.3, 0.1, 88.0, depth_m=1.5),
        _stop(4.9, 0.0, 85.0, depth_m=1.5),
        _stop(3.0, -0.1, 268.0, depth_m=1.4),
    )
    return Site("keyhole", (wall,), floor_m=2.6, stops=stops)


def pool() -> Site:
    """Return a tiled swimming pool, 8 x 5 m, 2 m deep."""
    stops = (_stop(-2.2, 0.4, 10.0), _stop(-0.6, -0.7, 60.0), _stop(1.2, 0.5, 95.0), _stop(2.5, -0.6, 140.0))
    return Site("pool", (Wall(np.array(rectangle(-4, -2.5, 4, 2.5))),), floor_m=2.0, stops=stops, material=TILE)


def hall() -> Site:
    """Return a rectangular hall with three pillars and a side chamber behind a doorway, hewn walls, 3.2 m of water."""
    rng = np.random.default_rng(7)
    outline = [(-4.5, -2.5), (-4.5, 2.5), (1.2, 2.5), (1.2, 3.1), (0.2, 3.1), (0.2, 5.4), (3.4, 5.4), (3.4, 3.1)]
    outline += [(2.2, 3.1), (2.2, 2.5), (4.5, 2.5), (4.5, -2.5)]
    pillars = [rock_cut(rectangle(x - 0.3, -0.3, x + 0.3, 0.3), rng, roughness_m=0.015) for x in (-2.3, 0.0, 2.3)]
    stops = (
        _stop(-3.2, -1.2, 0.0),
        _stop(-1.2, -1.3, 40.0),
        _stop(1.2, -1.3, 90.0),
        _stop(3.3, -0.6, 30.0),
        _stop(2.6, 1.4, 320.0),
        _stop(1.7, 2.6, 355.0),
        _stop(1.8, 4.2, 10.0),
        _stop(0.6, 1.3, 250.0, via=((1.7, 2.6),)),
        _stop(-1.5, 1.3, 270.0),
        _stop(-3.4, 1.1, 200.0),
    )
    return Site("hall", (rock_cut(outline, rng, roughness_m=0.025), *pillars), floor_m=3.2, stops=stops)


def bell() -> Site:
    """Return a bell-shaped cistern: round, widening downwards by 0.22 of its radius each metre, with one niche."""
    outline = [*oval((0.0, 0.0), 4.2, 4.2, 12.0, 348.0), (-0.45, 3.1), (0.45, 3.1)]
    wall = rock_cut(outline, np.random.default_rng(1302))
    stops = (
        _stop(-0.5, -0.4, 0.0),
        _stop(0.7, -0.3, 70.0),
        _stop(0.4, 0.8, 10.0),
        _stop(-0.7, 0.5, 300.0),
        _stop(0.0, 0.0, 180.0, depth_m=2.2),
    )
    return Site("bell", (wall,), floor_m=3.4, stops=stops, taper_per_m=0.22)


def _stop(
    x_m: float, y_m: float, heading_deg: float, depth_m: float = 1.3, via: tuple[tuple[float, float], ...] = ()
) -> Stop:
    return Stop(x_m, y_m, depth_m, radians(heading_deg), via)


SITES: Final[dict[str, Callable[[], Site]]] = {"keyhole": keyhole, "pool": pool, "hall": hall, "bell": bell}
"""Every site that can be emulated, by name."""
