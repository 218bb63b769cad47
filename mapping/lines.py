"""Straight walls along the bearing: a wall seen by neighbouring beams is where they say together that it is.

In polar coordinates about the vehicle a straight wall is ``1 / range = a sin(bearing) + b cos(bearing)``: linear in
``a`` and ``b``.  Each beam's wall is fitted to its neighbours in a window around it, or only before or after it where
that fits much better: at corners.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

REACH_M: Final = 0.35
"""Neighbours along the wall within this take part ..."""
REACH_RAD: Final = math.radians(40.0)
"""... and within this angle."""
ROUNDS: Final = 3
ROBUST: Final = 2.0
"""Residuals of more standard deviations than this count less."""
ONE_SIDED: Final = 2.0
"""A window on one side is taken where its mean square residual is smaller than the whole one's by this factor."""
FEWEST: Final = 3
LEAST_SPARE: Final = 0.3
"""Residuals are over the points that two unknowns leave, at least this: three points always fit well."""
ALONG_SHARE: Final = 0.5
"""Part of a beam's error that its neighbours share: speckle and overlapping beams."""

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Fit:
    """Walls as the neighbours see them, ``(n,)`` each; nan where too few see one.

    ``range_m`` where a beam meets its wall, ``sd_m`` of that, ``slope`` the change of range with bearing in m/rad;
    ``wall`` ``(n, 2)`` holds ``a`` and ``b``.
    """

    range_m: Floats
    sd_m: Floats
    slope: Floats
    wall: Floats


def fit_walls(bearing_rad: Floats, range_m: Floats, sd_m: Floats, step_rad: float, *, closed: bool) -> Fit:
    """Fit a straight piece of wall to each beam's neighbourhood; nan ranges take no part."""
    n = len(range_m)
    reach = max(1, min(int(REACH_RAD / step_rad), (n - 1) // 2))
    offsets = np.arange(-reach, reach + 1)
    at = np.arange(n)[:, None] + offsets
    beside = at % n
    angle = bearing_rad[beside] - bearing_rad[:, None]
    z, sd = range_m[beside], sd_m[beside]
    own = range_m[:, None]
    apart = np.hypot(z * np.sin(angle), z * np.cos(angle) - own)
    usable = np.isfinite(apart) & (apart < REACH_M)
    if not closed:
        usable &= (at >= 0) & (at < n)
    z, sd = np.where(usable, z, 1.0), np.where(usable, sd, 1.0)
    near = np.where(usable, np.exp(-2.0 * (apart / REACH_M) ** 2), 0.0)
    # In the beam's own axes: its own range is 1 / b.
    fits = [_fit(np.sin(angle), np.cos(angle), z, sd, near * side) for side in (1.0, offsets <= 0, offsets >= 0)]
    misfit = np.stack([f[3] for f in fits]) * np.array([1.0, ONE_SIDED, ONE_SIDED])[:, None]
    best = np.argmin(np.where(np.isnan(misfit), np.inf, misfit), axis=0)
    rows = np.arange(n)
    a, b, sd_fit = (np.stack([f[k] for f in fits])[best, rows] for k in range(3))
    with np.errstate(divide="ignore", invalid="ignore"):
        met = np.where((b > 0.0) & np.isfinite(range_m), 1.0 / b, np.nan)
        slope = -a * met**2
    wall = np.stack(
        [a * np.cos(bearing_rad) + b * np.sin(bearing_rad), b * np.cos(bearing_rad) - a * np.sin(bearing_rad)]
    )
    return Fit(met, np.where(np.isfinite(met), sd_fit, np.nan), slope, wall.T)


def _fit(sine: Floats, cosine: Floats, z: Floats, sd: Floats, near: Floats) -> tuple[Floats, Floats, Floats, Floats]:
    """Weighted least squares of 1 / z by sine and cosine, row by row: a, b, sd of 1 / b, mean square of residuals."""
    robust = np.ones_like(z)
    scale = z**2 / sd
    for _ in range(ROUNDS):
        w = near * robust * scale**2
        ss, sc, cc = ((w * u * v).sum(axis=1) for u, v in ((sine, sine), (sine, cosine), (cosine, cosine)))
        sq, cq = ((w * u / z).sum(axis=1) for u in (sine, cosine))
        det = ss * cc - sc**2
        with np.errstate(divide="ignore", invalid="ignore"):
            a, b = (cc * sq - sc * cq) / det, (ss * cq - sc * sq) / det
        off = (a[:, None] * sine + b[:, None] * cosine - 1.0 / z) * scale
        robust = 1.0 / (1.0 + (off / ROBUST) ** 2)
    used = near > 0.0
    with np.errstate(divide="ignore", invalid="ignore"):
        spare = np.maximum((near * robust).sum(axis=1) - 2.0, LEAST_SPARE)
        square = (near * robust * off**2).sum(axis=1) / spare
        own = np.sqrt(ss / det) / b**2
    enough = (used.sum(axis=1) >= FEWEST) & (det > 0.0)
    shared = ALONG_SHARE * np.where(used, sd, np.inf).min(axis=1)
    total = np.hypot(own * np.sqrt(np.maximum(square, 1.0)), shared)
    return tuple(np.where(enough, v, np.nan) for v in (a, b, total, square))  # type: ignore[return-value]
