"""What registration sees of a scan or of the map: weighted wall points, and a field that scores other points."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt

from mapping.values import FREE, Grid, Pose, Returns

THIN_M = 0.1
"""One point per square of this side: walls near a station are sampled more densely than others."""
NORMAL_M = 0.35
"""Points within this tell the wall's direction."""
EVEN = 0.8
"""Exponent by which common wall directions are weighted down: two long walls must not drown the end wall."""
NORMAL_SPREAD_RAD = math.radians(12.0)
HIT_FREE = 0.05
"""Odds of a point in water that was seen free, against 1 at a wall ..."""
HIT_UNKNOWN = 0.3
"""... and of one where nothing is known: neutral."""
TRUSTED_SD_M = 0.08
"""Returns with a larger standard deviation count less."""
VAGUE_SD_M = 0.14
"""Returns from here on tell little of the place ..."""
VAGUE_TRUST = 0.08
"""... because along a tunnel they make ends that travel with the vehicle."""
WALL_LOG_ODDS = 0.4
"""Cells above this are walls to registration: it may use vague ones too."""
KNOWN_M = 0.3
PAD_M = 0.6
"""Unknown border around a field."""


@dataclass(frozen=True, slots=True)
class Points:
    """Wall points ``(n, 2)`` float64 (x, y), their trust ``(n,)``, weights of sum 1, normals in [0, pi) or nan."""

    xy_m: NDArray[np.float64]
    trust: NDArray[np.float64]
    weight: NDArray[np.float64]
    normal_rad: NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Field:
    """Scores of points: ``distance_m`` to the next wall and ``free`` per cell, both ``(rows, cols)``."""

    distance_m: NDArray[np.float64]
    free: NDArray[np.bool_]
    cell_m: float
    x0_m: float
    y0_m: float

    def scores(self, sigma_m: float) -> NDArray[np.float32]:
        """Log-likelihood ratio per cell against knowing nothing, ``(rows, cols)``, at a width of the walls."""
        near = np.exp(-0.5 * (self.distance_m / sigma_m) ** 2)
        odds = near + np.where(self.free, HIT_FREE, HIT_UNKNOWN)
        return np.log(odds / HIT_UNKNOWN).astype(np.float32)

    def cells(self, x_m: NDArray[np.floating], y_m: NDArray[np.floating]) -> NDArray[np.int32]:
        """Flat indices of places; beyond the border the border's own, where nothing is known."""
        rows, cols = self.free.shape
        col = np.clip((x_m - self.x0_m) / self.cell_m, 0, cols - 1).astype(np.int32)
        row = np.clip((y_m - self.y0_m) / self.cell_m, 0, rows - 1).astype(np.int32)
        return np.asarray(row * np.int32(cols) + col, dtype=np.int32)

    def known(self) -> NDArray[np.float32]:
        """1 where a point would be judged, in free water or at a wall, else 0, ``(rows, cols)``."""
        return (self.free | (self.distance_m < KNOWN_M)).astype(np.float32)


@dataclass(frozen=True, slots=True)
class View:
    """Points and field of one scan in its own axes (x right, y ahead), or of the map in the map's."""

    points: Points
    field: Field


def wall_points(bearing_rad: NDArray[np.float64], returns: Returns) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Places of the returns ``(n, 2)`` in the vehicle's axes (x right, y ahead), and their trust ``(n,)``, 0 to 1."""
    seen = np.isfinite(returns.range_m)
    r, b = returns.range_m[seen], bearing_rad[seen]
    trust = np.where(returns.sd_m[seen] < VAGUE_SD_M, np.minimum(1.0, TRUSTED_SD_M / returns.sd_m[seen]), VAGUE_TRUST)
    return np.stack([r * np.sin(b), r * np.cos(b)], axis=1), trust


def to_map(pose: Pose, xy_m: NDArray[np.float64]) -> NDArray[np.float64]:
    """Bring points ``(n, 2)`` from the vehicle's axes into the map's."""
    c, s = math.cos(pose.heading_rad), math.sin(pose.heading_rad)
    x = pose.x_m + c * xy_m[:, 0] + s * xy_m[:, 1]
    y = pose.y_m - s * xy_m[:, 0] + c * xy_m[:, 1]
    return np.stack([x, y], axis=1)


def from_map(pose: Pose, xy_m: NDArray[np.float64]) -> NDArray[np.float64]:
    """Bring points ``(n, 2)`` from the map's axes into the vehicle's."""
    c, s = math.cos(pose.heading_rad), math.sin(pose.heading_rad)
    dx, dy = xy_m[:, 0] - pose.x_m, xy_m[:, 1] - pose.y_m
    return np.stack([c * dx - s * dy, s * dx + c * dy], axis=1)


def thin(xy_m: NDArray[np.float64], trust: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Keep one point, the mean, per square of ``THIN_M`` with its mean trust; in order of the squares."""
    if not len(xy_m):
        return xy_m, trust
    squares = np.floor(xy_m / THIN_M).astype(np.int64)
    _, member, count = np.unique(squares, axis=0, return_inverse=True, return_counts=True)
    member = member.reshape(-1)
    x, y, t = (np.bincount(member, v) / count for v in (xy_m[:, 0], xy_m[:, 1], trust))
    return np.stack([x, y], axis=1), t


def normals(xy_m: NDArray[np.float64]) -> NDArray[np.float64]:
    """Direction of the wall's normal at each point ``(n,)`` in [0, pi), nan where too few points tell it."""
    apart = xy_m[:, None, :] - xy_m[None, :, :]
    near = (apart**2).sum(axis=2) < NORMAL_M**2
    count = near.sum(axis=1)
    mean = near @ xy_m / np.maximum(count, 1)[:, None]
    square = near @ (xy_m[:, :, None] * xy_m[:, None, :]).reshape(-1, 4) / np.maximum(count, 1)[:, None]
    cov = square.reshape(-1, 2, 2) - mean[:, :, None] * mean[:, None, :]
    along = 0.5 * np.arctan2(2.0 * cov[:, 0, 1], cov[:, 0, 0] - cov[:, 1, 1])
    longish = np.hypot(2.0 * cov[:, 0, 1], cov[:, 0, 0] - cov[:, 1, 1]) > 0.5 * (cov[:, 0, 0] + cov[:, 1, 1])
    return np.where((count >= 3) & longish, (along + 0.5 * math.pi) % math.pi, np.nan)


def even_weights(normal_rad: NDArray[np.float64], trust: NDArray[np.float64]) -> NDArray[np.float64]:
    """Weights ``(n,)`` of sum 1, lower where many points share a wall direction."""
    apart = np.abs(normal_rad[:, None] - normal_rad[None, :])
    apart = np.minimum(apart, math.pi - apart)
    density = np.nansum(np.exp(-0.5 * (apart / NORMAL_SPREAD_RAD) ** 2), axis=1)
    known = np.isfinite(normal_rad)
    typical = float(np.median(density[known])) if known.any() else 1.0
    weight = trust * np.where(known, density, typical).clip(1.0) ** -EVEN
    return np.asarray(weight / weight.sum(), dtype=np.float64)


def points_of(xy_m: NDArray[np.float64], trust: NDArray[np.float64]) -> Points:
    """Thin and weigh points of walls."""
    thinned, mean_trust = thin(xy_m, trust)
    normal = normals(thinned)
    return Points(thinned, mean_trust, even_weights(normal, mean_trust), normal)


def field_of(grid: Grid) -> Field:
    """Make the field of a grid, with a border of unknown."""
    pad = math.ceil(PAD_M / grid.cell_m)
    state = np.pad(grid.state, pad)
    wall = np.pad(grid.log_odds, pad) > WALL_LOG_ODDS
    distance = np.full(state.shape, 1e3) if not wall.any() else np.asarray(distance_transform_edt(~wall)) * grid.cell_m
    return Field(distance, state == FREE, grid.cell_m, grid.x0_m - pad * grid.cell_m, grid.y0_m - pad * grid.cell_m)
