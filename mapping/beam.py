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
from scipy.special import erf

from mapping.values import Returns, Scan

OCCUPIED_LOG_ODDS = 3.0
"""Of a wall whose range is known to about a cell; less where the range is less sure."""
FREE_LOG_ODDS = -0.9
THICK = 0.5
"""A wall is drawn at least this thick, in cells, about its face: to one side only, rooms would come out too large."""
CORE = 0.4
"""Within so many cells of its likeliest place a face is told as surely as it lies within one cell of there: a wall that
is surely there, if not to the centimetre, is drawn as one thin line."""
HINT_LOG_ODDS = 0.5
"""Occupied by no more than this is a hint: hints of several scans are not added up, for they err alike."""
VAGUE_LOG_ODDS = 0.45
"""A vague return's hint, within its standard deviation."""
FORWARD_M = 0.005
"""Walls are drawn so much before their faces: nothing is told free behind them, which moves what is drawn back."""
BACK_M = 0.05
"""Behind its face a wall goes on at least so far, hardly seen: a hint."""
PLACE_SD_M = 0.005
"""What a station's place and its compass add to the range's standard deviation."""
VAGUE_SD_M = 0.12
"""Returns of more than this draw no wall ..."""
BLIND_SD_M = 0.3
"""... and of more than this give no hint."""
FINE_RAD = math.radians(0.3)
"""Bearing step of the table: 5 cm at 10 m."""
JOIN_M = 0.12
"""Neighbouring returns are one wall where their ranges differ by no more than this ..."""
JOIN_SLOPE = 2.5
"""... or by this times the arc between them (68 degrees of incidence) ..."""
JOIN_STEEPEST = 5.0
"""... or by this times it (79 degrees), where they lie on a straight line with the return before or after ..."""
JOIN_BENT = 0.25
"""... but for this share of their difference."""
LEAST_SQUARE = 0.2
"""A wall is not taken to be met at more of a slant than this cosine of incidence."""
SPREAD = 0.08
"""Share of the arc within the beam by which an oblique wall's range is unsure."""


@dataclass(frozen=True, slots=True)
class PolarEvidence:
    """Log-odds ``(n_bearings, n_ranges)`` float32 in steps of ``FINE_RAD`` and ``range_step_m``, bearing 0 first."""

    log_odds: NDArray[np.float32]
    range_step_m: float


@dataclass(frozen=True, slots=True)
class Fan:
    """Returns in fine bearings, ``(n,)`` float64 each: nan ranges and zero free water where nothing is said.

    ``square`` is the cosine of the incidence at which a wall is met, 1 where it is not known.
    """

    range_m: NDArray[np.float64]
    sd_m: NDArray[np.float64]
    free_m: NDArray[np.float64]
    square: NDArray[np.float64]


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
    joined = _goes_on(z, bearing)[left] & (gap < 2.5 * step_rad)
    range_m = np.where(joined, 1.0 / ((1.0 - share) / z[left] + share / z[right]), z[nearest])
    slope = np.where(joined, np.abs(z[right] - z[left]) / np.maximum(gap, 1e-9), 0.0)
    fan_sd = np.hypot(np.where(joined, np.fmax(sd[left], sd[right]), sd[nearest]), SPREAD * beam_rad * slope)
    open_to_it = joined & (free[left] >= z[left]) & (free[right] >= z[right])
    fan_free = np.where(open_to_it, range_m, np.where(joined, np.minimum(free[left], free[right]), free[nearest]))
    return Fan(
        np.where(covered, range_m, np.nan),
        np.where(covered, fan_sd, np.nan),
        np.where(covered, fan_free, 0.0),
        np.nan_to_num(range_m / np.hypot(range_m, slope), nan=1.0),
    )


def _goes_on(range_m: NDArray[np.float64], bearing_rad: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Whether each beam and the next see one wall, ``(n,)``; beams in order of bearing."""
    after = np.roll(range_m, -1)
    gap = np.roll(bearing_rad, -1) - bearing_rad
    gap %= 2.0 * math.pi
    step_m, arc = np.abs(after - range_m), np.fmin(range_m, after) * gap
    # Along a straight wall the curvature of 1 / range is -1 / range.
    bend = np.roll(1.0 / range_m, 1) - 2.0 / range_m + 1.0 / after + (gap / range_m) * gap
    bent_m = np.abs(bend) * range_m * np.fmin(range_m, after)
    straight = np.fmin(bent_m, np.roll(bent_m, -1)) < JOIN_BENT * step_m
    return np.asarray((step_m <= np.maximum(JOIN_M, JOIN_SLOPE * arc)) | (straight & (step_m <= JOIN_STEEPEST * arc)))


def polar_evidence(scan: Scan, returns: Returns, beam_rad: float, cell_m: float) -> PolarEvidence:
    """Compute what a scan says about each bearing and range, relative to its own heading.

    The wall's face lies at the return's range with its standard deviation.  A cell is occupied where the face is in it
    or next to it, free where the face is behind it, and unknown where the face is before it by more than that.
    """
    step_m = cell_m / 2.5
    fan = spread(scan.bearing_rad, returns, scan.step_rad, beam_rad)
    drawn = np.isfinite(fan.range_m) & (fan.sd_m < VAGUE_SD_M)
    hinted = np.isfinite(fan.range_m) & ~drawn & (fan.sd_m < BLIND_SD_M)
    heard_m = float(np.max(np.concatenate([fan.range_m[drawn | hinted], fan.free_m, [cell_m]])))
    ranges = (np.arange(math.ceil((heard_m + 8.0 * cell_m) / step_m)) + 0.5) * step_m
    sd, square = np.hypot(np.nan_to_num(fan.sd_m), PLACE_SD_M), np.maximum(fan.square, LEAST_SQUARE)
    clear_m = np.where(drawn, fan.range_m - 4.0 * sd - cell_m / square, np.fmin(fan.free_m, fan.range_m - 2.0 * sd))
    log_odds = np.where(ranges < clear_m[:, None], FREE_LOG_ODDS, 0.0).astype(np.float32)
    vague = hinted[:, None] & (np.abs(ranges - fan.range_m[:, None]) < fan.sd_m[:, None]) & (log_odds == 0.0)
    log_odds[vague] = VAGUE_LOG_ODDS
    faces = np.flatnonzero(drawn)
    far_m = fan.range_m[faces] + 4.0 * sd[faces] + (2.0 * cell_m + BACK_M) / square[faces]
    first, last = np.searchsorted(ranges, clear_m[faces]), np.searchsorted(ranges, far_m)
    at = first[:, None] + np.arange(int((last - first).max(initial=0)))
    row, column = np.nonzero(at < last[:, None])
    fine, at = faces[row], at[row, column]
    behind_m = (ranges[at] - fan.range_m[fine]) * square[fine] + FORWARD_M
    log_odds[fine, at] = of_face(behind_m, sd[fine] * square[fine], cell_m)
    return PolarEvidence(log_odds, step_m)


def of_face(behind_m: NDArray[np.float64], sd_m: NDArray[np.float64], cell_m: float) -> NDArray[np.float64]:
    """Log-odds ``(n,)`` of cells whose centres lie ``behind_m`` behind faces of walls as they were measured."""
    half = 0.5 * (1.0 + THICK) * cell_m
    before = 0.5 * (1.0 - erf((behind_m + half) / (sd_m * math.sqrt(2.0))))
    past = 0.5 * (1.0 + erf((behind_m - half) / (sd_m * math.sqrt(2.0))))
    within = 1.0 - before - past
    p = within * _odds(OCCUPIED_LOG_ODDS) + before * _odds(FREE_LOG_ODDS) + past * 0.5
    log_odds = np.log(p / (1.0 - p))
    behind = (behind_m > 0.0) & (behind_m < BACK_M + 2.0 * sd_m)
    log_odds = np.where(behind, np.maximum(log_odds, VAGUE_LOG_ODDS), log_odds)
    near = erf(cell_m / (sd_m * math.sqrt(2.0)))
    p = near * _odds(OCCUPIED_LOG_ODDS) + (1.0 - near) * 0.5 * (_odds(FREE_LOG_ODDS) + 0.5)
    core = np.abs(behind_m) <= CORE * cell_m
    return np.asarray(np.where(core, np.maximum(log_odds, np.log(p / (1.0 - p))), log_odds), dtype=np.float64)


def _odds(log_odds: float) -> float:
    return 1.0 / (1.0 + math.exp(-log_odds))
