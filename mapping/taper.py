"""Between two levels of a well: walls taper about the well's axis, so a scan made deeper fits once it is scaled.

Scaled about the vehicle, such a scan falls onto the walls of the other level; the place where it does is the vehicle's
own, scaled about the axis.  The axis is the middle of the water that the other level saw open.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from config.schema import Map
from mapping.register import Match
from mapping.sight import Sight, sight_of
from mapping.values import Pose, Returns
from mapping.view import Field, View

WIDEST: Final = 0.3
"""Largest widening of a well for each metre of depth, as a share of its width ..."""
STEPS: Final = 5
"""... tried in so many steps to either side, and then between the best and its neighbours."""
AXIS_SD_M: Final = 0.2
SCALE_SD: Final = 0.02

Floats = NDArray[np.float64]


def best_scaled(sight: Sight, reference: View, rise_m: float, config: Map, fit: Callable[[View], Match]) -> list[Match]:
    """Match a scan at several scales with what another level saw, ``rise_m`` above or below; best scales come last."""
    axis = axis_of(reference.field)
    step = WIDEST * rise_m / STEPS
    scales = [1.0 + k * step for k in range(-STEPS, STEPS + 1)]
    found = [(scale, fit(scaled(sight, 1.0 / scale, config).view)) for scale in scales]
    best = max(found, key=lambda each: each[1].height)[0]
    finer = [best - 0.5 * step, best + 0.5 * step]
    found += [(scale, fit(scaled(sight, 1.0 / scale, config).view)) for scale in finer]
    return [unscaled(match, scale, axis) for scale, match in found]


def scaled(sight: Sight, by: float, config: Map) -> Sight:
    """Bring all walls nearer to the vehicle, or farther away, by a factor."""
    r = sight.returns
    return sight_of(sight.scan, Returns(r.range_m * by, r.sd_m, r.free_m * by), config)


def axis_of(field: Field) -> Floats:
    """Middle ``(2,)`` of the open water of a field."""
    row, col = np.nonzero(field.free)
    if not len(row):
        return np.zeros(2)
    return np.array([field.x0_m + (col.mean() + 0.5) * field.cell_m, field.y0_m + (row.mean() + 0.5) * field.cell_m])


def unscaled(match: Match, scale: float, axis: Floats) -> Match:
    """Tell where the vehicle was, whose scan fitted when it was scaled by ``1 / scale``."""

    def of(pose: Pose) -> Pose:
        x, y = axis + scale * (np.array([pose.x_m, pose.y_m]) - axis)
        return Pose(float(x), float(y), pose.heading_rad)

    pose = of(match.pose)
    arm = np.array([pose.x_m, pose.y_m]) - axis
    covariance = match.covariance.copy()
    covariance[:2, :2] += ((scale - 1.0) * AXIS_SD_M) ** 2 * np.eye(2) + SCALE_SD**2 * np.outer(arm, arm)
    return replace(match, pose=pose, covariance=covariance, other=of(match.other))
