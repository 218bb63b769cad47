"""What registration sees of a scan or of the map: weighted wall points, and a field that scores other points."""

from __future__ import annotations

import math
from dataclasses import dataclass
from dataclasses import field as dataclass_field

import numpy as np
from numpy.typing import NDArray

from mapping.field import Field as Field
from mapping.field import field_of as field_of
from mapping.values import Pose, Returns

THIN_M = 0.1
"""One point per square of this side: walls near a station are sampled more densely than others."""
NORMAL_M, FEW_NEAR = 0.35, 3
"""Points within this tell the wall's direction, if there are so many ..."""
SPARSE, SPARSE_M, SPARSE_LENGTH = 4, 1.5, 0.97
"""... or else so many others, within this, that lie on a line: by the difference of their variances over the sum."""
EVEN = 0.8
"""Exponent by which common wall directions are weighted down: two long walls must not drown the end wall."""
NORMAL_SPREAD_RAD = math.radians(12.0)
TRUSTED_SD_M = 0.08
"""Returns with a larger standard deviation count less."""
VAGUE_SD_M = 0.14
"""Returns from here on tell little of the place ..."""
VAGUE_TRUST = 0.08
"""... because along a tunnel they make ends that travel with the vehicle."""
ROUGH_M = 0.3
"""So far around points where walls end, meet or are cluttered, places are told apart from those at plain walls."""
LEVEL_M, LEVELS = 0.025, 48
"""Steps of distance in a view's codes, and how many."""


@dataclass(frozen=True, slots=True)
class Points:
    """Wall points ``(n, 2)`` float64 (x, y), their trust ``(n,)``, weights of sum 1, normals in [0, pi) or nan."""

    xy_m: NDArray[np.float64]
    trust: NDArray[np.float64]
    weight: NDArray[np.float64]
    normal_rad: NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class View:
    """Points and field of one scan in its own axes (x right, y ahead), or of the map in the map's.

    ``codes`` ``(cells,)`` uint8 tell the field's places apart for scoring, see ``codes_of``.
    """

    points: Points
    field: Field
    codes: NDArray[np.uint8] = dataclass_field(init=False)

    def __post_init__(self) -> None:
        """Work out the codes once, not at every registration."""
        object.__setattr__(self, "codes", codes_of(self.field, self.points))


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
    """Direction of the wall's normal at each point ``(n,)`` in [0, pi), nan where no plain wall is seen there.

    A wall seen at a slant is seen in few points far apart: where there are few nearby, the nearest few tell it, if
    they lie on a line.
    """
    n = len(xy_m)
    near = _near(xy_m)
    lonely = near.sum(axis=1) < FEW_NEAR
    if n > SPARSE and lonely.any():
        square_m2 = ((xy_m[lonely, None, :] - xy_m[None, :, :]) ** 2).sum(axis=2)
        reach_m2 = np.partition(square_m2, SPARSE, axis=1)[:, SPARSE]
        near[lonely] = square_m2 <= np.minimum(reach_m2, SPARSE_M**2)[:, None]
    count = near.sum(axis=1)
    mean = near @ xy_m / np.maximum(count, 1)[:, None]
    square = near @ (xy_m[:, :, None] * xy_m[:, None, :]).reshape(-1, 4) / np.maximum(count, 1)[:, None]
    cov = square.reshape(-1, 2, 2) - mean[:, :, None] * mean[:, None, :]
    along = 0.5 * np.arctan2(2.0 * cov[:, 0, 1], cov[:, 0, 0] - cov[:, 1, 1])
    length = np.hypot(2.0 * cov[:, 0, 1], cov[:, 0, 0] - cov[:, 1, 1]) / np.maximum(cov[:, 0, 0] + cov[:, 1, 1], 1e-12)
    longish = length > np.where(lonely, SPARSE_LENGTH, 0.5)
    return np.where((count >= np.where(lonely, SPARSE, FEW_NEAR)) & longish, (along + 0.5 * math.pi) % math.pi, np.nan)


def _near(xy_m: NDArray[np.float64]) -> NDArray[np.bool_]:
    return np.asarray(((xy_m[:, None, :] - xy_m[None, :, :]) ** 2).sum(axis=2) < NORMAL_M**2)


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


def codes_of(field: Field, points: Points) -> NDArray[np.uint8]:
    """Tell places apart for scoring, ``(cells,)``: steps of distance to the next wall, free or not, rough or plain."""
    level = np.minimum(field.distance_m / LEVEL_M + 0.5, LEVELS - 1).astype(np.uint8)
    rough = ~np.isfinite(points.normal_rad)
    nearer = _stamped(field, points.xy_m[rough]) < _stamped(field, points.xy_m[~rough])
    codes = (level + np.uint8(LEVELS) * field.free + np.uint8(2 * LEVELS) * nearer).astype(np.uint8)
    codes[[0, -1], :] = codes[:, [0, -1]] = LEVELS - 1  # and all beyond: nothing is known
    return codes.ravel()


def _stamped(field: Field, xy_m: NDArray[np.float64]) -> NDArray[np.float32]:
    """Distance of each cell to the next of some points, infinite beyond ``ROUGH_M``, ``(rows, cols)``."""
    rows, cols = field.free.shape
    out = np.full(rows * cols, np.inf, dtype=np.float32)
    reach = math.ceil(ROUGH_M / field.cell_m)
    at = np.floor((xy_m - [field.x0_m, field.y0_m]) / field.cell_m).astype(np.int64)
    inside = (at >= reach).all(axis=1) & (at < np.array([cols, rows]) - reach).all(axis=1)
    offset = np.arange(-reach, reach + 1)
    col, row = at[inside, 0][:, None] + offset, at[inside, 1][:, None] + offset
    dx = (col + 0.5) * field.cell_m + field.x0_m - xy_m[inside, :1]
    dy = (row + 0.5) * field.cell_m + field.y0_m - xy_m[inside, 1:]
    apart = np.hypot(dx[:, None, :], dy[:, :, None]).astype(np.float32)
    np.minimum.at(out, (row[:, :, None] * cols + col[:, None, :]).ravel(), apart.ravel())
    out[out > ROUGH_M] = np.inf
    return out.reshape(rows, cols)
