"""Is the vehicle at rest?  Each beam is compared with the beam that looked the same way before.

What stands out of the water tells: its profile along the range falls onto the profile of the turn (or the sweep)
before, or beside it.  What nearly all bearings show alike stays when the vehicle moves, and is taken out first.  Who
drives along smooth walls sees the same walls all the while, but other grain of them: speckle is frozen only while
nothing moves.  It is fresh at every ping where a vehicle trembles, so grain speaks in dives in which it was once seen
to be frozen.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

SMOOTH_M = 0.1
"""Gaussian smoothing of a profile along the range."""
COMMON_PERCENT = 40.0
CLEAR = 10.0
"""Counts above the common profile from which an echo stands out ..."""
CAP = 60.0
"""... and beyond which it stands out no more."""
STILL_M = 0.05
"""Echoes that fall onto each other within this have not moved."""
SECTOR_BEAMS = 8
"""Neighbouring beams that are judged together."""
ALIKE = 0.6
"""Correlation from which a sector is the same; at rest 19 of 20 sectors have more than 0.73."""
GRAIN_M = 0.25
"""Speckle is what remains of the echoes when their mean over this range is taken away ..."""
GRAIN_LEVEL = 60.0
"""... where that mean is above so many counts."""
FROZEN = 0.5
"""Correlation of a sector's grain with the turn before: still above, moving below (0.8 to 0.99 against -0.4 to 0.2)."""
FAINT = 0.1
"""Sectors with less than this share of the usual energy say nothing."""

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Agreement:
    """Products of a beam with its earlier partner, ``(2 k + 1,)`` over lags of -k to k bins, and their mean energy.

    ``grain`` ``(3,)`` holds the sums of products of both beams' speckle: one by the other, and each by itself.
    """

    products: Floats
    energy: float
    grain: Floats


def profile(echoes: NDArray[np.uint8], bin_m: float, min_range_m: float) -> Floats:
    """Smooth the echoes beyond ``min_range_m``: ``(n,)`` float64."""
    sd_bins = SMOOTH_M / bin_m
    reach = max(1, math.ceil(3.0 * sd_bins))
    kernel = np.exp(-0.5 * (np.arange(-reach, reach + 1) / max(sd_bins, 0.3)) ** 2)
    kernel = kernel[: 2 * ((len(echoes) - 1) // 2) + 1]
    smooth = np.convolve(echoes.astype(np.float64), kernel / kernel.sum(), mode="same")
    return np.asarray(smooth[min(len(smooth) // 2, int(min_range_m / bin_m)) :], dtype=np.float64)


def common_to_all(profiles: list[Floats]) -> Floats:
    """Find what nearly all bearings show at a range: ringing, surface, floor, noise."""
    return np.asarray(np.percentile(np.stack(profiles), COMMON_PERCENT, axis=0), dtype=np.float64)


def compare(now: Floats, before: Floats, common: Floats, bin_m: float, grain: Floats) -> Agreement:
    """Multiply what stands out of two profiles, over lags within ``STILL_M``."""
    a, b = (np.clip(p - common - CLEAR, 0.0, CAP) for p in (now, before))
    lags = max(1, round(STILL_M / bin_m))
    return Agreement(np.correlate(np.pad(b, lags), a, mode="valid"), 0.5 * float(a @ a + b @ b), grain)


def grain_of(now: NDArray[np.uint8], before: NDArray[np.uint8], bin_m: float, min_range_m: float) -> Floats:
    """Multiply the speckle of two beams where either is loud: ``(3,)``, see `Agreement`."""
    first, width = min(len(now) // 2, int(min_range_m / bin_m)), max(3, round(GRAIN_M / bin_m))
    one, other = now[first:].astype(np.float64), before[first:].astype(np.float64)
    mean_one, mean_other = (np.convolve(e, np.full(width, 1.0 / width), mode="same")[: len(e)] for e in (one, other))
    loud = (mean_one > GRAIN_LEVEL) | (mean_other > GRAIN_LEVEL)
    a, b = (one - mean_one)[loud], (other - mean_other)[loud]
    return np.array([a @ b, a @ a, b @ b])


def frozen(recent: list[Agreement]) -> float:
    """Correlation of a sector's speckle with what it was before; nan where nothing is loud."""
    by_other, by_one, by_itself = np.sum([a.grain for a in recent], axis=0)
    return float(by_other / math.sqrt(by_one * by_itself)) if by_one * by_itself > 0.0 else math.nan


def still(recent: list[Agreement], usual_energy: float) -> bool | None:
    """Tell whether a sector of beams lies still: True, False, or None where the echoes do not say."""
    energy = sum(a.energy for a in recent)
    if energy <= FAINT * usual_energy * len(recent):
        return None
    return bool(max(np.sum([a.products for a in recent], axis=0)) >= ALIKE * energy)
