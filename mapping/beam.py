"""Inverse sensor model: what one scan says about occupancy, as log-odds over bearing and range.

Neighbouring beams overlap (3 degrees of beam at 1.8 degrees of step), so they are not independent witnesses.  A
direction is therefore told once, by the beams next to it: their returns are joined along the wall they both see, and
no cell is counted twice by one scan.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mapping.values import Returns, Scan

OCCUPIED_LOG_ODDS = 2.4
"""Of a wall whose range is known to about a cell; less where the range is less sure."""
FREE_LOG_ODDS = -0.9
FINE_RAD = math.radians(0.3)
"""Bearing step of the table: 5 cm at 10 m."""
JOIN_M = 0.12
"""Neighbouring returns are one wall where their ranges differ by no more than this ..."""
JOIN_SLOPE = 2.5
"""... or by this times the arc between them (68 degrees of incidence)."""
SPREAD = 0.15
"""Share of the arc within the beam by which an oblique wall's range is unsure."""


@dataclass(frozen=True, slots=True)
class PolarEvidence:
    """Log-odds ``(n_bearings, n_ranges)`` float32 in steps of ``FINE_RAD`` and ``range_step_m``, bearing 0 first."""

    log_odds: NDArray[np.float32]
    range_step_m: float


@dataclass(frozen=True, slots=True)
class Fan:
    """Returns in fine bearings, ``(n,)`` float64 each: nan ranges and zero free water where nothing is said."""

    range_m: NDArray[np.float64]
    sd_m: NDArray[np.float64]
    free_m: NDArray[np.float64]


def spread(bearing_rad: NDArray[np.float64], returns: Returns, step_rad: float, beam_rad: float) -> Fan:
    """Spread beams over fine bearings; between two beams that see one wall the wall runs straight.

    A straight wall is linear in 1 / range over small angles.  A direction with no beam within half a beam's width (or
    half a step, where steps are wider) says nothing.
    """
    n_fine = round(2.0 * math.pi / FINE_RAD)
    fine = np.arange(n_fine) * (2.0 * math.pi / n_fine)
    order = np.argsort(bearing_rad % (2.0 * math.pi), kind="stable")
    bearing = bearing_rad[order] % (2.0 * math.pi)
    right = np.searchsorted(bearing, fine) % len(bearing)
    left = right - 1
    gap = (bearing[right] - bearing[left]) % (2.0 * math.pi)
    share = ((fine - bearing[left]) % (2.0 * math.pi)) / np.maximum(gap, 1e-9)
    nearest = np.where(share < 0.5, left, right)
    off = np.minimum(share, 1.0 - share) * gap
    covered = off <= max(0.5 * beam_rad, 0.55 * step_rad)
    z, sd, free = returns.range_m[order], returns.sd_m[order], returns.free_m[order]
    arc = np.fmin(z[left], z[right]) * gap
    joined = (np.abs(z[right] - z[left]) <= np.maximum(JOIN_M, JOIN_SLOPE * arc)) & (gap < 2.5 * step_rad)
    range_m = np.where(joined, 1.0 / ((1.0 - share) / z[left] + share / z[right]), z[nearest])
    slope = np.where(joined, np.abs(z[right] - z[left]) / np.maximum(gap, 1e-9), 0.0)
    fan_sd = np.hypot(np.where(joined, np.fmax(sd[left], sd[right]), sd[nearest]), SPREAD * beam_rad * slope)
    fan_free = np.where(joined, range_m, np.minimum(free[nearest], np.maximum(free[left], free[right])))
    return Fan(
        np.where(covered, range_m, np.nan),
        np.where(covered, fan_sd, np.nan),
        np.where(covered, fan_free, 0.0),
    )


def polar_evidence(scan: Scan, returns: Returns, beam_rad: float, cell_m: float) -> PolarEvidence:
    """Compute what a scan says about each bearing and range, relative to its own heading."""
    step_m = cell_m / 2.5
    fan = spread(scan.bearing_rad, returns, scan.step_rad, beam_rad)
    heard_m = float(np.nanmax(np.concatenate([fan.range_m, fan.free_m, [cell_m]])))
    ranges = (np.arange(math.ceil((heard_m + 6.0 * cell_m) / step_m)) + 0.5) * step_m
    sd = np.hypot(fan.sd_m, 0.4 * cell_m)[:, None]
    away = (ranges[None, :] - fan.range_m[:, None]) / sd
    peak = OCCUPIED_LOG_ODDS * np.minimum(1.0, cell_m / sd)
    occupied = np.where(np.abs(away) < 3.5, peak * np.exp(-0.5 * away**2), 0.0)
    clear_m = np.where(np.isfinite(fan.range_m), np.fmin(fan.free_m, fan.range_m - 2.0 * sd[:, 0]), fan.free_m)
    free = np.where(ranges[None, :] < clear_m[:, None], FREE_LOG_ODDS, 0.0)
    log_odds = np.where(np.isnan(fan.range_m)[:, None], free, np.where(free < 0.0, free, occupied))
    return PolarEvidence(log_odds.astype(np.float32), step_m)
