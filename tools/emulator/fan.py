"""A fan of rays and what the walls send back along it: directly, after bounces, and by way of the vehicle itself."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from tools.emulator import beam
from tools.emulator.rays import NOTHING_M, Hits, Segments, corners, trace
from tools.emulator.site import Site
from tools.emulator.texture import Texture

Floats = NDArray[np.float64]

WALL_DB: Final = 56.0
"""Level of a wall that would return all of the beam at one range, at normal incidence."""

ELEVATION_EDGES: Final[Floats] = np.radians(np.arange(-26.0, 26.1, 4.0))
"""Slices of the beam's height for direct echoes."""

_FEW_EDGES: Final[Floats] = np.radians(np.array([-21.0, -7.0, 7.0, 21.0]))
_FLOOR_MIRROR: Final = 0.15
_SURFACE_MIRROR: Final = 0.6
_SELF_DB: Final = -24.0
_SELF_COSINE: Final = 0.994
_LONGEST_SMEAR_M: Final = 3.0


@dataclass(frozen=True, slots=True)
class View:
    """From where, and how finely, the site is looked at."""

    x_m: float
    y_m: float
    depth_m: float
    bin_m: float
    bins: int


@dataclass(frozen=True, slots=True)
class Plan:
    """Walls and corners ``(k, 2)`` at a depth."""

    segments: Segments
    corners_m: Floats


@dataclass(frozen=True, slots=True)
class Fan:
    """What rays return: ``angle_rad`` ``(n,)``, ``power`` ``(n, bins)``, way in plan to the wall ``way_m`` ``(n,)``."""

    angle_rad: Floats
    power: Floats
    way_m: Floats


def height_weights(edges: Floats) -> Floats:
    """Share of the beam's power that each slice of its height carries."""
    whole = (beam.vertical((ELEVATION_EDGES[1:] + ELEVATION_EDGES[:-1]) / 2) * np.diff(ELEVATION_EDGES)).sum()
    return np.asarray(beam.vertical((edges[1:] + edges[:-1]) / 2) * np.diff(edges) / whole, dtype=np.float64)


class Walls:
    """The walls of a site as rays meet them."""

    def __init__(self, site: Site, seed: int) -> None:
        self._site = site
        self._texture = Texture(seed, site.material.texture_db)
        self._level = 10.0 ** ((WALL_DB + site.material.backscatter_db) / 10.0)
        self._plans: dict[float, Plan] = {}

    def plan(self, depth_m: float) -> Plan:
        """Return walls and corners at a depth, to the centimetre; an upright site has one plan."""
        depth_m = round(depth_m, 2) if self._site.taper_per_m else self._site.plan_depth_m
        if depth_m not in self._plans:
            walls = self._site.plan_at(depth_m)
            self._plans[depth_m] = Plan(Segments.of(walls), corners(walls))
        return self._plans[depth_m]

    def look(self, view: View, angle_rad: Floats, step_rad: float, bounces: int) -> Fan:
        """Send rays along compass angles, each ``step_rad`` wide, and spread what comes back over range."""
        first, *later = trace(self.plan(view.depth_m).segments, np.array([view.x_m, view.y_m]), angle_rad, bounces)
        # A wall met squarely sends the ping back onto the vehicle, which returns some of it once more.
        again_m = np.where(first.cosine > _SELF_COSINE, 2.0 * first.way_m, NOTHING_M)
        ghosts = _joined([*later, replace(first, way_m=again_m)])
        losses_db = [2.0 * count * self._site.material.mirror_db for count in range(1, bounces + 1)] + [_SELF_DB]
        loss = np.repeat(10.0 ** (np.array(losses_db) / 10.0), len(angle_rad))
        slope = self._lean(first, angle_rad, view.depth_m)
        parts = (
            self._echoes(view, first, slope, step_rad, ELEVATION_EDGES, np.ones(len(angle_rad))),
            self._echoes(view, ghosts, np.zeros(len(loss)), step_rad, _FEW_EDGES, loss),
        )
        near, far, power = (np.concatenate(each) for each in zip(*parts, strict=True))
        rays = np.arange(len(angle_rad))
        direct_rows = np.repeat(rays, len(ELEVATION_EDGES) - 1)
        ghost_rows = np.repeat(np.tile(rays, bounces + 1), len(_FEW_EDGES) - 1)
        rows = np.concatenate([direct_rows, ghost_rows])
        spread = beam.spread_rows(near, far, power, view.bin_m, view.bins, rows, len(rays))
        return Fan(angle_rad, spread, first.way_m)

    def _echoes(
        self, view: View, hits: Hits, slope: Floats, step_rad: float, edges: Floats, loss: Floats
    ) -> tuple[Floats, Floats, Floats]:
        """Return near, far and power of the echoes of rays, slice by slice of the beam's height.

        ``slope`` tells how far each ray's wall recedes for a metre of depth.
        """
        middle = (edges[1:] + edges[:-1]) / 2
        cosine = np.maximum(hits.cosine, 0.02)[:, None]
        lean = slope[:, None]
        stretch = cosine / np.maximum(cosine - lean * np.tan(edges), 0.2 * cosine)
        range_edges = hits.way_m[:, None] * stretch / np.cos(edges)
        across = hits.way_m[:, None] * np.sqrt(1.0 - np.minimum(cosine, 1.0) ** 2) / cosine * step_rad
        half = (np.abs(np.diff(range_edges, axis=1)) + np.minimum(across, _LONGEST_SMEAR_M) + beam.PULSE_M) / 2
        centre = (range_edges[:, 1:] + range_edges[:, :-1]) / 2
        facing = (cosine * np.cos(middle) - lean * np.sin(middle)) / np.hypot(1.0, lean)
        strength = (loss * self._texture.at(hits.point_m) * (hits.way_m < NOTHING_M))[:, None]
        power = strength * self._backscatter(facing) * self._height_loss(view, hits.way_m, middle)
        power *= height_weights(edges)
        return (centre - half).ravel(), (centre + half).ravel(), power.ravel()

    def _lean(self, hits: Hits, angle_rad: Floats, depth_m: float) -> Floats:
        """How far walls recede from the sonar for each metre of depth, along their normals."""
        taper = self._site.taper_per_m
        if not taper:
            return np.zeros(len(angle_rad))
        segments = self.plan(depth_m).segments
        direction = np.stack([np.sin(angle_rad), np.cos(angle_rad)], axis=1)
        normal = segments.normal[hits.segment]
        away = normal * np.sign((direction * normal).sum(axis=1))[:, None]
        arm = segments.centre[hits.segment] - np.array(self._site.centre_m)
        scale = 1.0 + taper * (depth_m - self._site.plan_depth_m)
        return np.asarray((away * arm).sum(axis=1) * taper / scale, dtype=np.float64)

    def _backscatter(self, cosine: Floats) -> Floats:
        """Power that a wall returns by the cosine of incidence: a lobe about the normal over a rough rest."""
        angle = np.degrees(np.arccos(np.clip(cosine, 0.0, 1.0)))
        lobe = 0.75 * np.exp(-((angle / 14.0) ** 2))
        rough = 0.25 * np.maximum(cosine, 0.0) ** 1.5
        return np.asarray((lobe + rough) * self._level, dtype=np.float64)

    def _height_loss(self, view: View, way_m: Floats, elevation_rad: Floats) -> Floats:
        """Share left after the floor and the surface or ceiling that a ray off the horizontal meets on its way."""
        sink = np.minimum(way_m, 1e3)[:, None] * np.tan(elevation_rad)
        height = self._site.floor_m - self._site.ceiling_m
        below, above = self._site.floor_m - view.depth_m, view.depth_m - self._site.ceiling_m
        hits = np.where(sink > 0, np.ceil((sink - below) / height), np.ceil((-sink - above) / height)).clip(0, 8)
        upper = _FLOOR_MIRROR if self._site.is_flooded else _SURFACE_MIRROR
        first = np.where(sink > 0, _FLOOR_MIRROR, upper)
        other = np.where(sink > 0, upper, _FLOOR_MIRROR)
        return np.asarray(first ** np.ceil(hits / 2) * other ** np.floor(hits / 2), dtype=np.float64)


def _joined(parts: list[Hits]) -> Hits:
    return Hits(
        np.concatenate([each.way_m for each in parts]),
        np.concatenate([each.segment for each in parts]),
        np.concatenate([each.cosine for each in parts]),
        np.concatenate([each.point_m for each in parts]),
    )
