"""Is the vehicle at rest?  Each beam is compared with the beam that looked the same way before.

Speckle is no help: it is frozen in a still tank and fresh at every ping when the vehicle trembles.  What stands out of
the water does: its profile along the range falls onto the profile of the turn (or the sweep) before, or beside it.
What nearly all bearings show alike stays when the vehicle moves, and is taken out first.
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
FAINT = 0.1
"""Sectors with less than this share of the usual energy say nothing."""


@dataclass(frozen=True, slots=True)
class Agreement:
    """Products of a beam with its earlier partner, ``(2 k + 1,)`` over lags of -k to k bins, and their mean energy."""

    products: NDArray[np.float64]
    energy: float


def profile(echoes: NDArray[np.uint8], bin_m: float, min_range_m: float) -> NDArray[np.float64]:
    """Smooth the echoes beyond ``min_range_m``: ``(n,)`` float64."""
    sd_bins = SMOOTH_M / bin_m
    reach = max(1, math.ceil(3.0 * sd_bins))
    kernel = np.exp(-0.5 * (np.arange(-reach, reach + 1) / max(sd_bins, 0.3)) ** 2)
    kernel = kernel[: 2 * ((len(echoes) - 1) // 2) + 1]
    smooth = np.convolve(echoes.astype(np.float64), kernel / kernel.sum(), mode="same")
    return np.asarray(smooth[min(len(smooth) // 2, int(min_range_m / bin_m)) :], dtype=np.float64)


def common_to_all(profiles: list[NDArray[np.float64]]) -> NDArray[np.float64]:
    """Find what nearly all bearings show at a range: ringing, surface, floor, noise."""
    return np.asarray(np.percentile(np.stack(profiles), COMMON_PERCENT, axis=0), dtype=np.float64)


def compare(
    now: NDArray[np.float64], before: NDArray[np.float64], common: NDArray[np.float64], bin_m: float
) -> Agreement:
    """Multiply what stands out of two profiles, over lags within ``STILL_M``."""
    a, b = (np.clip(p - common - CLEAR, 0.0, CAP) for p in (now, before))
    lags = max(1, round(STILL_M / bin_m))
    return Agreement(np.correlate(np.pad(b, lags), a, mode="valid"), 0.5 * float(a @ a + b @ b))


def still(recent: list[Agreement], usual_energy: float) -> bool | None:
    """Tell whether a sector of beams lies still: True, False, or None where the echoes do not say."""
    energy = sum(a.energy for a in recent)
    if energy <= FAINT * usual_energy * len(recent):
        return None
    return bool(max(np.sum([a.products for a in recent], axis=0)) >= ALIKE * energy)
