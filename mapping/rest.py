"""Is the vehicle at rest?  Each beam is compared with the beam that looked the same way before.

Speckle is no help: it is frozen in a still tank and fresh at every ping when the vehicle trembles.  What a move does
to a beam is to shift its echoes along the range.  So profiles of neighbouring beams are correlated, over lags, with
those of the turn (or the sweep) before, and the lag of the best correlation of a small sector is the move seen in
that direction.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

SMOOTH_M = 0.06
"""Gaussian smoothing of a profile along the range, before correlation."""
REACH_M = 0.5
"""Largest lag that is tried."""
STILL_M = 0.08
"""Lags up to this are rest: three times what beams at rest show."""
SECTOR_BEAMS = 8
"""Neighbouring beams whose correlations are averaged."""
FAINT = 0.2
"""Correlations below this say nothing about rest or motion."""


@dataclass(frozen=True, slots=True)
class Agreement:
    """Correlation of a beam with its earlier partner, ``(2 k + 1,)`` float64 over lags of -k to k bins."""

    correlation: NDArray[np.float64]
    bin_m: float


def profile(echoes: NDArray[np.uint8], bin_m: float, min_range_m: float) -> NDArray[np.float64]:
    """Echoes beyond the ringing, smoothed, with zero mean: ``(n,)`` float64."""
    sd_bins = SMOOTH_M / bin_m
    reach = max(1, math.ceil(3.0 * sd_bins))
    kernel = np.exp(-0.5 * (np.arange(-reach, reach + 1) / max(sd_bins, 0.3)) ** 2)
    smooth = np.convolve(echoes.astype(np.float64), kernel / kernel.sum(), mode="same")
    beyond = smooth[min(len(smooth) // 2, int(min_range_m / bin_m)) :]
    return np.asarray(beyond - beyond.mean(), dtype=np.float64)


def compare(now: NDArray[np.float64], before: NDArray[np.float64], bin_m: float) -> Agreement:
    """Correlate two profiles over lags of up to ``REACH_M``, normalised to 1 for equal profiles at lag 0."""
    lags = max(1, min(round(REACH_M / bin_m), len(now) // 4))
    norm = math.sqrt(float(now @ now) * float(before @ before)) or 1.0
    return Agreement(np.correlate(before, now[lags:-lags], mode="valid") / norm, bin_m)


def still(recent: list[Agreement]) -> bool | None:
    """Tell whether a sector of beams lies still: True, False, or None where the echoes do not say."""
    mean = np.mean([a.correlation for a in recent], axis=0)
    best = int(np.argmax(mean))
    if mean[best] < FAINT:
        return None
    bin_m = recent[-1].bin_m
    lag_m = abs(best - len(mean) // 2) * bin_m
    return bool(lag_m <= max(STILL_M, 1.5 * bin_m))
