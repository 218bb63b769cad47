"""The wall's place within one beam's echo."""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.special import erf

from mapping.clutter import COUNTS_A_DB

SNAP_BACK_M: Final = 0.06
SNAP_ON_M: Final = 0.15
"""The peak is looked for this far before and behind the line, which clings to leading edges."""
STRONG: Final = 12.0
"""Counts below the highest nearby at which the first peak is taken."""
COUNTS_6_DB: Final = 6.0 * COUNTS_A_DB
_DECADE: Final = 10.0 * COUNTS_A_DB
NOISE: Final = 1.5 * COUNTS_A_DB
"""The mean power of noise is this far above its usual level."""
CENTRE_M: Final = 0.12
"""The echo's power within this of its peak counts for its centre."""
LATE_BEFORE: Final = 0.5
LATE_BEHIND: Final = 3.0
"""... and so much more, in shares of what a leaning wall's power is late."""
TAIL_M: Final = 0.01
"""A rough wall's echo has a tail, which draws its centre on: measured on two emulators of different makers."""
LOBE: Final = 0.45
"""Share of the beam's mean square elevation that walls return: they send back most of what meets them squarely."""

Floats = NDArray[np.float64]


def snap(excess: Floats, line: NDArray[np.intp], bin_m: float) -> NDArray[np.intp]:
    """Bin of the first strong local peak next to a line, ``(n,)``; the line's own where there is none."""
    bins = excess.shape[1]
    offsets = np.arange(-round(SNAP_BACK_M / bin_m), max(1, round(SNAP_ON_M / bin_m)) + 1)
    at = np.clip(line[:, None] + offsets, 1, bins - 2)
    here = np.take_along_axis(excess, at, axis=1)
    left = np.take_along_axis(excess, at - 1, axis=1)
    right = np.take_along_axis(excess, at + 1, axis=1)
    peak = (here >= left) & (here >= right) & (here > here.max(axis=1, keepdims=True) - STRONG)
    first = at[np.arange(len(line)), peak.argmax(axis=1)]
    return np.where(peak.any(axis=1), first, line)


def centre_m(echoes: Floats, floor: Floats, at: NDArray[np.intp], bin_m: float, late_m: Floats | None = None) -> Floats:
    """Range ``(n,)`` of the centre of the echoes' power about their peaks at the bins ``at``.

    The centre is steadier than the peak under speckle and does not move with the slant.  ``floor`` ``(bins,)`` is the
    level of the noise, which would draw faint echoes' centres to their peaks.  Where the power lies ``late_m`` ``(n,)``
    behind its front (``mapping.lean``), as much more of the echo counts.
    """
    late = np.zeros(len(at)) if late_m is None else late_m
    before = np.maximum(np.rint((CENTRE_M + LATE_BEFORE * late) / bin_m), 1.0)[:, None]
    behind = np.maximum(np.rint((CENTRE_M + LATE_BEHIND * late) / bin_m), 1.0)[:, None]
    offset = np.arange(-int(before.max(initial=1.0)), int(behind.max(initial=1.0)) + 1)
    window = np.clip(at[:, None] + offset, 0, echoes.shape[1] - 1)
    level, noise = np.take_along_axis(echoes, window, axis=1), floor[window] + NOISE
    power = np.maximum(10.0 ** (level / _DECADE) - 10.0 ** (noise / _DECADE), 0.0)
    power = np.where((offset >= -before) & (offset <= behind), power, 0.0)
    power[:, np.flatnonzero(offset == 0)] += 1e-9
    return np.asarray((power * (window + 0.5)).sum(axis=1) / power.sum(axis=1) * bin_m, dtype=np.float64)


def longer_m(range_m: Floats, half_height_rad: float, late_m: Floats | None = None) -> Floats:
    """By how much the centre of an upright wall's echo reads long, ``(n,)``.

    The slant range exceeds the horizontal one by half the elevation squared, the elevation being normal over the
    beam's two-way pattern; what is later than ``CENTRE_M`` does not count.
    """
    late = np.zeros_like(range_m) if late_m is None else late_m
    sd = half_height_rad * math.sqrt(LOBE / (1.2 * math.log(10.0)))
    cut = np.sqrt(2.0 * (CENTRE_M + LATE_BEHIND * late) / np.maximum(range_m, 1e-3)) / sd
    left = 1.0 - cut * math.sqrt(2.0 / math.pi) * np.exp(-0.5 * cut**2) / erf(cut / math.sqrt(2.0))
    return np.asarray(TAIL_M + 0.5 * range_m * sd**2 * left, dtype=np.float64)


def width_of(excess: Floats, at: NDArray[np.intp]) -> Floats:
    """Width of the peaks at -6 dB, ``(n,)`` bins."""
    bins = np.arange(excess.shape[1])
    low = excess < (excess[np.arange(len(at)), at] - COUNTS_6_DB)[:, None]
    last = np.where(low & (bins > at[:, None]), bins, len(bins)).min(axis=1)
    first = np.where(low & (bins < at[:, None]), bins, -1).max(axis=1)
    return np.asarray(last - first - 1, dtype=np.float64)
