"""From echoes to returns: where each beam sees the wall, or that it does not say.

The first strong peak of a beam, not the strongest: second bounces come later and may be as loud.  A beam abstains
rather than guess: where its echo has no clear place along the range, or where its neighbours disagree.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from config.schema import Map
from mapping.values import Returns, Scan

DB_PER_COUNT = 80.0 / 255.0
RINGING_M = 0.8
"""The transducer rings to here at most; what all bearings show alike within it is no echo."""
RINGING_EXCESS = 18.0
"""Counts by which an echo must exceed what all bearings show within the zone of ringing."""
SMOOTH_M = 0.03
STRONG = 25.0
"""Counts below its beam's maximum at which a peak still is a wall's."""
LOUD = 12.0
"""Counts by which a peak must stand above its beam's own floor."""
WIDE_M = 0.5
"""Echoes within 6 dB of the peak that spread further than this have no clear place."""
AGREE_M = 0.10
"""Neighbours agree within this much a beam between them."""
BASE_SD_M = 0.02


def pick(scan: Scan, config: Map) -> Returns:
    """Find the wall return of each beam of a scan."""
    n, bins = scan.echoes.shape
    if n == 0 or bins < 8:
        return Returns(np.full(n, np.nan), np.full(n, np.nan), np.zeros(n))
    clear = without_ringing(scan.echoes, scan.bin_m, config.min_range_m)
    smooth = gaussian_filter1d(clear, SMOOTH_M / scan.bin_m, axis=1, mode="nearest")
    peaks = first_strong_peak(smooth)
    range_m = range_of(smooth, peaks, scan.bin_m) + config.range_offset_m
    sure = is_loud(smooth, peaks) & ~is_wide(smooth, peaks, scan.bin_m)
    bearing = scan.bearing_rad % (2.0 * math.pi)
    order = np.argsort(bearing, kind="stable")
    sure[order] &= agrees(np.where(sure, range_m, np.nan)[order], bearing[order], scan.step_rad)
    sd_m = np.hypot(BASE_SD_M, width_of(smooth, peaks, scan.bin_m) / 4.0)
    near_m = np.where(peaks >= 0, nearest_edge(smooth, peaks) * scan.bin_m, 0.0)
    free_m = np.where(sure, range_m, np.minimum(near_m, range_m) - 2.0 * SMOOTH_M)
    return Returns(np.where(sure, range_m, np.nan), np.where(sure, sd_m, np.nan), np.maximum(free_m, 0.0))


def without_ringing(echoes: NDArray[np.uint8], bin_m: float, min_range_m: float) -> NDArray[np.float64]:
    """Echoes ``(n, bins)`` with what all bearings show near the head taken out."""
    clear = echoes.astype(np.float64)
    zone = min(echoes.shape[1], math.ceil(RINGING_M / bin_m))
    common = np.median(clear[:, :zone], axis=0)
    clear[:, :zone] = np.where(clear[:, :zone] > common + RINGING_EXCESS, clear[:, :zone], 0.0)
    clear[:, : math.ceil(min_range_m / bin_m)] = 0.0
    return clear


def first_strong_peak(smooth: NDArray[np.float64]) -> NDArray[np.intp]:
    """Bin of each beam's first local maximum within ``STRONG`` of its highest, ``(n,)``; -1 where there is none."""
    peak = np.zeros(smooth.shape, dtype=np.bool_)
    peak[:, 1:-1] = (smooth[:, 1:-1] >= smooth[:, :-2]) & (smooth[:, 1:-1] > smooth[:, 2:])
    highest = smooth.max(axis=1, keepdims=True)
    strong = peak & (smooth >= highest - STRONG) & (smooth > 0.0)
    return np.where(strong.any(axis=1), strong.argmax(axis=1), -1)


def range_of(smooth: NDArray[np.float64], peaks: NDArray[np.intp], bin_m: float) -> NDArray[np.float64]:
    """Range of the peaks, between bins by a parabola, ``(n,)`` metres; nan without a peak."""
    rows = np.arange(len(peaks))
    at = np.clip(peaks, 1, smooth.shape[1] - 2)
    left, top, right = smooth[rows, at - 1], smooth[rows, at], smooth[rows, at + 1]
    bend = np.minimum(left - 2.0 * top + right, -1e-9)
    shift = np.clip(0.5 * (left - right) / bend, -0.5, 0.5)
    return np.where(peaks >= 0, (at + 0.5 + shift) * bin_m, np.nan)


def is_loud(smooth: NDArray[np.float64], peaks: NDArray[np.intp]) -> NDArray[np.bool_]:
    """Whether a peak stands above its beam's floor, the lower quartile of its echoes."""
    top = smooth[np.arange(len(peaks)), np.maximum(peaks, 0)]
    return np.asarray((peaks >= 0) & (top > np.quantile(smooth, 0.25, axis=1) + LOUD))


def is_wide(smooth: NDArray[np.float64], peaks: NDArray[np.intp], bin_m: float) -> NDArray[np.bool_]:
    """Whether echoes within 6 dB of the beam's highest spread too far to have one place."""
    loud = smooth >= smooth.max(axis=1, keepdims=True) - 6.0 / DB_PER_COUNT
    first = loud.argmax(axis=1)
    last = smooth.shape[1] - 1 - loud[:, ::-1].argmax(axis=1)
    return np.asarray((np.maximum(last, peaks) - np.minimum(first, peaks)) * bin_m > WIDE_M)


def width_of(smooth: NDArray[np.float64], peaks: NDArray[np.intp], bin_m: float) -> NDArray[np.float64]:
    """Width of the peak at -6 dB, ``(n,)`` metres."""
    rows = np.arange(len(peaks))
    at = np.maximum(peaks, 0)
    low = smooth < (smooth[rows, at] - 6.0 / DB_PER_COUNT)[:, None]
    bins = np.arange(smooth.shape[1])
    last = np.where(low & (bins > at[:, None]), bins, smooth.shape[1]).min(axis=1)
    first = np.where(low & (bins < at[:, None]), bins, -1).max(axis=1)
    return np.asarray((last - first - 1) * bin_m, dtype=np.float64)


def nearest_edge(smooth: NDArray[np.float64], peaks: NDArray[np.intp]) -> NDArray[np.float64]:
    """Bin of the first echo that is not plain water, ``(n,)``: nothing was heard before it."""
    floor = np.quantile(smooth, 0.25, axis=1, keepdims=True)
    heard = smooth > floor + LOUD
    first = np.where(heard.any(axis=1), heard.argmax(axis=1), smooth.shape[1])
    return np.asarray(np.minimum(first, np.where(peaks >= 0, peaks, smooth.shape[1])), dtype=np.float64)


def agrees(range_m: NDArray[np.float64], bearing_rad: NDArray[np.float64], step_rad: float) -> NDArray[np.bool_]:
    """Whether at least 2 of the 4 neighbouring beams tell about the same range; beams in order of bearing."""
    votes = np.zeros(len(range_m), dtype=np.intp)
    for away in (-2, -1, 1, 2):
        apart = np.abs((np.roll(bearing_rad, away) - bearing_rad + math.pi) % (2.0 * math.pi) - math.pi)
        near = apart < (abs(away) + 0.8) * step_rad
        with np.errstate(invalid="ignore"):
            votes += near & (np.abs(np.roll(range_m, away) - range_m) <= AGREE_M * abs(away))
    return np.asarray(votes >= 2)
