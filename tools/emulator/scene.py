"""Power over range of one beam in a site: walls, floor, surface, corners, bounces, through main and side lobes.

The main lobe is made of fine rays of its own for every ping.  Side lobes look at the whole circle through a coarse fan
that is kept until the vehicle has moved.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from tools.emulator import beam
from tools.emulator.rays import NOTHING_M, Hits, Segments, cast, corners, trace
from tools.emulator.site import Site
from tools.emulator.texture import Texture

Floats = NDArray[np.float64]

_FINE_STEP: Final = np.radians(0.5)
_FINE_HALF: Final = np.radians(6.0)
_COARSE_STEP: Final = np.radians(2.0)
_BOUNCES: Final = 3
_ELEVATION_EDGES: Final[Floats] = np.radians(np.arange(-26.0, 26.1, 4.0))
_FEW_ELEVATION_EDGES: Final[Floats] = np.radians(np.array([-21.0, -7.0, 7.0, 21.0]))
_KEPT_WITHIN_M: Final = 0.004

WALL_DB: Final = 56.0
"""Level of a wall that would return all of the beam at one range, at normal incidence."""
_FLOOR_DB: Final = 56.0
_SURFACE_DB: Final = 44.0
_FLOOR_MIRROR: Final = 0.15
_SURFACE_MIRROR: Final = 0.6
_SELF_DB: Final = -24.0
_SELF_COSINE: Final = 0.994


@dataclass(frozen=True, slots=True)
class _Fan:
    """What a fan of rays returns for each of its directions: power ``(rays, bins)``, and the ways in plan."""

    angle_rad: Floats
    power: Floats
    way_m: Floats


@dataclass(frozen=True, slots=True)
class _Key:
    x_m: float
    y_m: float
    depth_m: float
    bin_m: float
    bins: int

    def near(self, other: _Key) -> bool:
        moved = max(abs(self.x_m - other.x_m), abs(self.y_m - other.y_m), abs(self.depth_m - other.depth_m))
        return moved <= _KEPT_WITHIN_M and self.bin_m == other.bin_m and self.bins == other.bins


class Scene:
    """The site as a beam sees it; keeps the side lobes' fan of the last place."""

    def __init__(self, site: Site, seed: int) -> None:
        self._site = site
        self._texture = Texture(seed, site.material.texture_db)
        self._lobe = beam.main_lobe_rad()
        self._segments: tuple[float, Segments, Floats] | None = None
        self._fan: tuple[_Key, _Fan] | None = None

    def power(self, x_m: float, y_m: float, depth_m: float, angle_rad: float, bin_m: float, bins: int) -> Floats:
        """Return the echo's power ``(bins,)`` (0 dB is one) of a beam along a compass angle, before speckle."""
        key = _Key(x_m, y_m, depth_m, bin_m, bins)
        offsets = np.arange(-_FINE_HALF + _FINE_STEP / 2, _FINE_HALF, _FINE_STEP)
        fine = self._look(key, angle_rad + offsets, _FINE_STEP)
        coarse = self._side_fan(key)
        from_axis = np.abs((coarse.angle_rad - angle_rad + np.pi) % (2 * np.pi) - np.pi)
        outside = np.clip((from_axis - _FINE_HALF) / _COARSE_STEP + 0.5, 0.0, 1.0)
        weight_fine = beam.horizontal(offsets) * (_FINE_STEP / self._lobe)
        weight_coarse = beam.horizontal(from_axis) * outside * (_COARSE_STEP / self._lobe)
        total = weight_fine @ fine.power + weight_coarse @ coarse.power
        total += self._corners(key, angle_rad)
        total += self._level_planes(
            key, np.concatenate([fine.way_m, coarse.way_m]), np.concatenate([weight_fine, weight_coarse])
        )
        return np.asarray(total, dtype=np.float64)

    def _plan(self, depth_m: float) -> tuple[Segments, Floats]:
        """Return the walls and corners at a depth; an upright site has one plan."""
        depth = round(depth_m, 2) if self._site.taper_per_m else 0.0
        if self._segments is None or self._segments[0] != depth:
            walls = self._site.plan_at(depth) if self._site.taper_per_m else self._site.walls
            self._segments = (depth, Segments.of(walls), corners(walls))
        return self._segments[1], self._segments[2]

    def _side_fan(self, key: _Key) -> _Fan:
        if self._fan is None or not self._fan[0].near(key):
            angles = np.arange(0.0, 2.0 * np.pi - 1e-9, _COARSE_STEP)
            self._fan = (key, self._look(key, angles, _COARSE_STEP))
        return self._fan[1]

    def _look(self, key: _Key, angle_rad: Floats, step_rad: float) -> _Fan:
        """Cast rays and spread what they meet over range."""
        segments, _ = self._plan(key.depth_m)
        ways = trace(segments, np.array([key.x_m, key.y_m]), angle_rad, _BOUNCES)
        parts = [self._answer(key, ways[0], angle_rad, step_rad, _ELEVATION_EDGES, 1.0, lean=True)]
        for count, hits in enumerate(ways[1:], start=1):
            loss = 10.0 ** (2.0 * count * self._site.material.mirror_db / 10.0)
            parts.append(self._answer(key, hits, angle_rad, step_rad, _FEW_ELEVATION_EDGES, loss))
        # A wall met squarely sends the ping back onto the vehicle, which returns some of it once more.
        square = ways[0].cosine > _SELF_COSINE
        again = Hits(np.where(square, 2.0 * ways[0].way_m, NOTHING_M), ways[0].segment, ways[0].cosine, ways[0].point_m)
        parts.append(self._answer(key, again, angle_rad, step_rad, _FEW_ELEVATION_EDGES, 10.0 ** (_SELF_DB / 10.0)))
        near, far, power, row = (np.concatenate(each) for each in zip(*parts, strict=True))
        rows = beam.spread_rows(near, far, power, key.bin_m, key.bins, row.astype(np.intp), len(angle_rad))
        return _Fan(angle_rad, rows, ways[0].way_m)

    def _answer(
        self, key: _Key, hits: Hits, angle_rad: Floats, step_rad: float, edges: Floats, loss: float, lean: bool = False
    ) -> tuple[Floats, Floats, Floats, Floats]:
        """Return near, far, power and row of the echoes of rays, over the beam's height."""
        middle = (edges[1:] + edges[:-1]) / 2
        weight = beam.vertical(middle) * np.diff(edges)
        weight /= beam.vertical(_ELEVATION_EDGES).sum() * (_ELEVATION_EDGES[1] - _ELEVATION_EDGES[0])
        slope = (
            self._lean(hits, angle_rad, key.depth_m) if lean and self._site.taper_per_m else np.zeros(len(angle_rad))
        )
        cosine = np.maximum(hits.cosine, 0.02)
        stretch = cosine[:, None] / np.maximum(cosine[:, None] - slope[:, None] * np.tan(edges), 0.2 * cosine[:, None])
        range_edges = hits.way_m[:, None] * stretch / np.cos(edges)
        across = hits.way_m * np.sqrt(1.0 - np.minimum(hits.cosine, 1.0) ** 2) / cosine * step_rad
        half = (np.abs(np.diff(range_edges, axis=1)) + np.minimum(across, 3.0)[:, None] + beam.PULSE_M) / 2
        centre = (range_edges[:, 1:] + range_edges[:, :-1]) / 2
        facing = (hits.cosine[:, None] * np.cos(middle) - slope[:, None] * np.sin(middle)) / np.hypot(1.0, slope)[
            :, None
        ]
        strength = (loss * self._texture.at(hits.point_m))[:, None]
        power = strength * self._backscatter(facing) * weight * self._height_loss(key, hits.way_m, middle)
        power[hits.way_m >= NOTHING_M] = 0.0
        rows = np.repeat(np.arange(len(angle_rad), dtype=np.float64), len(middle))
        return (centre - half).ravel(), (centre + half).ravel(), power.ravel(), rows

    def _lean(self, hits: Hits, angle_rad: Floats, depth_m: float) -> Floats:
        """How far walls recede from the sonar for each metre of depth, along their normals."""
        segments, _ = self._plan(depth_m)
        direction = np.stack([np.sin(angle_rad), np.cos(angle_rad)], axis=1)
        normal = segments.normal[hits.segment]
        away = normal * np.sign((direction * normal).sum(axis=1))[:, None]
        scale = 1.0 + self._site.taper_per_m * (depth_m - self._site.plan_depth_m)
        arm = segments.centre[hits.segment] - np.array(self._site.centre_m)
        return np.asarray((away * arm).sum(axis=1) * self._site.taper_per_m / scale, dtype=np.float64)

    def _backscatter(self, cosine: Floats) -> Floats:
        """Power that a wall returns by the cosine of incidence: a lobe about the normal over a rough rest."""
        angle = np.degrees(np.arccos(np.clip(cosine, 0.0, 1.0)))
        lobe = 0.75 * np.exp(-((angle / 14.0) ** 2))
        rough = 0.25 * np.maximum(cosine, 0.0) ** 1.5
        return np.asarray((lobe + rough) * 10.0 ** ((WALL_DB + self._site.material.backscatter_db) / 10.0))

    def _height_loss(self, key: _Key, way_m: Floats, elevation_rad: Floats) -> Floats:
        """Share left after the floor and the surface that a ray off the horizontal meets on its way."""
        sink = way_m[:, None] * np.tan(elevation_rad)
        room = self._site.floor_m
        below, above = room - key.depth_m, key.depth_m
        hits = np.where(sink > 0, np.ceil((sink - below) / room), np.ceil((-sink - above) / room)).clip(0, 8)
        first = np.where(sink > 0, _FLOOR_MIRROR, _SURFACE_MIRROR)
        other = np.where(sink > 0, _SURFACE_MIRROR, _FLOOR_MIRROR)
        return np.asarray(first ** np.ceil(hits / 2) * other ** np.floor(hits / 2), dtype=np.float64)

    def _corners(self, key: _Key, angle_rad: float) -> Floats:
        """Echo of re-entrant corners: they send the beam back whence it came."""
        segments, points = self._plan(key.depth_m)
        if not len(points):
            return np.zeros(key.bins)
        arm = points - np.array([key.x_m, key.y_m])
        way = np.hypot(arm[:, 0], arm[:, 1])
        seen = cast(segments, np.array([[key.x_m, key.y_m]]), arm / way[:, None]).way_m >= way - 0.08
        weight = beam.horizontal(np.arctan2(arm[:, 0], arm[:, 1]) - angle_rad) * seen
        level = WALL_DB - 5.0 + self._site.material.corner_db
        power = weight * 10.0 ** (level / 10.0)
        return beam.spread(way - beam.PULSE_M / 2, way * 1.02 + beam.PULSE_M / 2, power, key.bin_m, key.bins)

    def _level_planes(self, key: _Key, way_m: Floats, weight: Floats) -> Floats:
        """Echo of floor and surface: from the range where the beam's height first meets them, up to the walls."""
        ranges = (np.arange(key.bins) + 0.5) * key.bin_m
        order = np.argsort(way_m)
        left = np.concatenate([[0.0], np.cumsum(weight[order][::-1])])[::-1]
        total = np.zeros(key.bins)
        for height, level in ((self._site.floor_m - key.depth_m, _FLOOR_DB), (key.depth_m, _SURFACE_DB)):
            sine = np.minimum(max(height, 0.02) / ranges, 1.0)
            cosine = np.sqrt(1.0 - sine**2)
            elevation = np.arcsin(sine)
            open_share = left[np.searchsorted(way_m[order], ranges * cosine)]
            per_metre = sine / (ranges * np.maximum(cosine, 0.2))
            height_weight = beam.vertical(elevation) / (beam.vertical(_ELEVATION_EDGES).sum() * np.radians(4.0))
            total += (
                10.0 ** (level / 10.0)
                * 0.25
                * sine**1.5
                * height_weight
                * per_metre
                * open_share
                * max(beam.PULSE_M, key.bin_m)
            )
        return total
