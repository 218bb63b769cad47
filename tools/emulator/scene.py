"""Power over range of one beam in a site: walls, corners, floor and surface, through main and side lobes.

The main lobe is made of fine rays of its own for every ping.  Side lobes look at the whole circle through a coarse fan
that is made for points of a lattice and kept until the vehicle nears another one: rings move in steps of a centimetre
or two, the echoes of the main lobe move with the vehicle.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from tools.emulator import beam
from tools.emulator.fan import ELEVATION_EDGES, WALL_DB, Fan, View, Walls
from tools.emulator.rays import cast
from tools.emulator.site import Site

Floats = NDArray[np.float64]

_FINE_STEP: Final = np.radians(0.5)
_FINE_HALF: Final = np.radians(6.0)
_OFFSETS: Final[Floats] = np.arange(-_FINE_HALF + _FINE_STEP / 2, _FINE_HALF, _FINE_STEP)
_BOUNCES: Final = 3
_COARSE_STEP: Final = np.radians(2.0)
_COARSE: Final[Floats] = np.arange(0.0, 2.0 * np.pi - 1e-9, _COARSE_STEP)
_COARSE_BOUNCES: Final = 2
_LATTICE_M: Final = 0.02

_FLOOR_DB: Final = 57.0
_SURFACE_DB: Final = 43.0
_CORNER_DB: Final = -5.0
_CORNER_SLACK_M: Final = 0.08


class Scene:
    """The site as a beam sees it; keeps the side lobes' fan of the last place."""

    def __init__(self, site: Site, seed: int) -> None:
        self._site = site
        self._walls = Walls(site, seed)
        lobe = beam.main_lobe_rad()
        self._fine_weight = beam.horizontal(_OFFSETS) * (_FINE_STEP / lobe)
        self._coarse_share = _COARSE_STEP / lobe
        self._side: tuple[View, Fan] | None = None

    def power(self, view: View, angle_rad: float) -> Floats:
        """Return the echo's power ``(bins,)`` (0 dB is one) of a beam along a compass angle, before speckle."""
        fine = self._walls.look(view, angle_rad + _OFFSETS, _FINE_STEP, _BOUNCES)
        side = self._side_fan(view)
        from_axis = np.abs((side.angle_rad - angle_rad + np.pi) % (2 * np.pi) - np.pi)
        outside = np.clip((from_axis - _FINE_HALF) / _COARSE_STEP + 0.5, 0.0, 1.0)
        weight = np.concatenate([self._fine_weight, beam.horizontal(from_axis) * outside * self._coarse_share])
        fine_count = len(_OFFSETS)
        total = weight[:fine_count] @ fine.power + weight[fine_count:] @ side.power
        total += self._corners(view, angle_rad)
        total += self._level_planes(view, np.concatenate([fine.way_m, side.way_m]), weight)
        return np.asarray(total, dtype=np.float64)

    def _side_fan(self, view: View) -> Fan:
        x_m, y_m, depth_m = (round(each / _LATTICE_M) * _LATTICE_M for each in (view.x_m, view.y_m, view.depth_m))
        near = View(x_m, y_m, depth_m, view.bin_m, view.bins)
        if self._side is None or self._side[0] != near:
            self._side = (near, self._walls.look(near, _COARSE, _COARSE_STEP, _COARSE_BOUNCES))
        return self._side[1]

    def _corners(self, view: View, angle_rad: float) -> Floats:
        """Echo of re-entrant corners: they send the beam back whence it came."""
        plan = self._walls.plan(view.depth_m)
        if not len(plan.corners_m):
            return np.zeros(view.bins)
        arm = plan.corners_m - np.array([view.x_m, view.y_m])
        way = np.maximum(np.hypot(arm[:, 0], arm[:, 1]), 1e-3)
        hits = cast(plan.segments, np.array([[view.x_m, view.y_m]]), arm / way[:, None])
        seen = hits.way_m >= way - _CORNER_SLACK_M
        level = WALL_DB + _CORNER_DB + self._site.material.corner_db
        power = beam.horizontal(np.arctan2(arm[:, 0], arm[:, 1]) - angle_rad) * seen * 10.0 ** (level / 10.0)
        return beam.spread(way - beam.PULSE_M / 2, way * 1.02 + beam.PULSE_M / 2, power, view.bin_m, view.bins)

    def _level_planes(self, view: View, way_m: Floats, weight: Floats) -> Floats:
        """Echo of floor and surface, or ceiling: from where the beam's height first meets them, up to the walls."""
        site = self._site
        upper_db = _FLOOR_DB if site.is_flooded else _SURFACE_DB
        ranges = (np.arange(view.bins) + 0.5) * view.bin_m
        order = np.argsort(way_m)
        left = np.concatenate([[0.0], np.cumsum(weight[order][::-1])])[::-1]
        whole = beam.vertical((ELEVATION_EDGES[1:] + ELEVATION_EDGES[:-1]) / 2) @ np.diff(ELEVATION_EDGES)
        total = np.zeros(view.bins)
        for height_m, level in ((site.floor_m - view.depth_m, _FLOOR_DB), (view.depth_m - site.ceiling_m, upper_db)):
            sine = np.minimum(max(height_m, 0.02) / ranges, 1.0)
            cosine = np.sqrt(1.0 - sine**2)
            open_share = left[np.searchsorted(way_m[order], ranges * cosine)]
            height_per_metre = sine / (ranges * np.maximum(cosine, 0.2)) * beam.vertical(np.arcsin(sine)) / whole
            # A rough plane returns less the flatter it is met.
            total += 10.0 ** (level / 10.0) * sine**1.5 * height_per_metre * open_share
        return np.asarray(total * max(beam.PULSE_M, view.bin_m), dtype=np.float64)
