"""From echoes to returns: where each beam sees the wall, or that it does not say.

The transducer's ringing and rings of constant range are taken out, a line is drawn through all beams
(``mapping.contour``), and each beam moves from the line to its first strong peak nearby.  A beam abstains rather than
guess: where its echo is faint, and where the line is broken.  Where the echo has no clear place along the range, as in
corners, or the line is rough or short, the return is vague: it has a large standard deviation.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from config.schema import Map
from mapping.contour import LOUD, trace
from mapping.values import Returns, Scan

COUNTS_6_DB = 6.0 * 255.0 / 80.0
RINGING_M = 0.8
"""The transducer rings to here at most; what all bearings show alike within it is no echo."""
RINGING_EXCESS = 18.0
"""Counts by which an echo must exceed what all bearings show within the zone of ringing."""
RINGING_LEVEL = 40.0
SMOOTH_M = 0.04
RING_WIDTH_M = 0.4
"""What all bearings show at one range, narrower than this, is a side-lobe ring, a surface or a floor ..."""
RING_FAINT = 20.0
"""... if it is fainter than the walls by these counts; in a round room the wall itself is such a ring."""
SNAP_BACK_M, SNAP_ON_M = 0.06, 0.15
"""The peak is looked for this far before and behind the line, which clings to leading edges."""
STRONG = 12.0
"""Counts below the highest nearby at which the first peak is taken."""
FAINT = 20.0
"""Counts above the floor, median of five beams along the line, below which a beam abstains."""
ROUGH_M = 0.12
"""Second difference of the range from beam to beam beyond which a beam abstains."""
WIDE_M = 0.35
"""A beam with more than this at the level of its peak, less 6 dB, has no clear place: a corner, or noise."""
SHORT_M = 0.3
"""A wall of which less than this is seen without a break is no wall."""
NEIGHBOUR_RAD = math.radians(30.0)
"""A silent beam is vouched for by the walls seen within this on either side."""
BASE_SD_M = 0.02
VAGUE_SD_M = 0.15
"""Least standard deviation of a vague return: it helps to place a scan, and draws no wall."""


@dataclass(frozen=True, slots=True)
class _Peaks:
    """Per beam in order of bearing, ``(n,)`` each: bins and ranges of the peaks, which are sure and which heard."""

    bins: NDArray[np.intp]
    range_m: NDArray[np.float64]
    sure: NDArray[np.bool_]
    heard: NDArray[np.bool_]


def pick(scan: Scan, config: Map) -> Returns:
    """Find the wall return of each beam of a scan."""
    n, bins = scan.echoes.shape
    if n < 5 or bins < 16:
        return Returns(np.full(n, np.nan), np.full(n, np.nan), np.zeros(n))
    order, closed = in_order(scan)
    echoes = without_ringing(scan.echoes[order], scan.bin_m, config.min_range_m)
    excess = above_floor(gaussian_filter1d(echoes, SMOOTH_M / scan.bin_m, axis=1, mode="nearest"), scan.bin_m)
    peaks = peaks_along(excess, scan, closed=closed)
    width_m = width_of(excess, peaks.bins) * scan.bin_m
    sd_m = np.where(peaks.sure, np.hypot(BASE_SD_M, width_m / 4.0), np.maximum(VAGUE_SD_M, width_m / 2.0))
    free_m = np.where(peaks.sure, peaks.range_m, quiet_water(excess, peaks, scan, closed=closed))
    back = np.empty(n, dtype=np.intp)
    back[order] = np.arange(n)
    offset = config.range_offset_m
    range_m = np.where(peaks.heard, np.maximum(peaks.range_m + offset, 0.0), np.nan)
    return Returns(range_m[back], np.where(peaks.heard, sd_m, np.nan)[back], np.maximum(free_m + offset, 0.0)[back])


def in_order(scan: Scan) -> tuple[NDArray[np.intp], bool]:
    """Order of the beams by bearing, a sector's from its one end to the other; and whether they close a circle."""
    bearing = scan.bearing_rad % (2.0 * math.pi)
    order = np.argsort(bearing, kind="stable")
    gaps = np.diff(bearing[order], append=bearing[order[0]] + 2.0 * math.pi)
    widest = int(np.argmax(gaps))
    if gaps[widest] <= 4.0 * scan.step_rad:
        return order, True
    return np.roll(order, -(widest + 1)), False


def without_ringing(echoes: NDArray[np.uint8], bin_m: float, min_range_m: float) -> NDArray[np.float64]:
    """Echoes ``(n, bins)`` with what all bearings show near the head taken out."""
    clear = echoes.astype(np.float64)
    zone = min(echoes.shape[1], math.ceil(RINGING_M / bin_m))
    near = clear[:, :zone]
    common = np.median(near, axis=0)
    echo = np.where(common > RINGING_LEVEL, near - common, near)
    clear[:, :zone] = np.where(near > common + RINGING_EXCESS, echo, 0.0)
    clear[:, : math.ceil(min_range_m / bin_m)] = 0.0
    return clear


def above_floor(smooth: NDArray[np.float64], bin_m: float) -> NDArray[np.float64]:
    """Echoes above the noise of their range and above faint rings of constant range, in counts."""
    common = np.median(smooth, axis=0)
    ring = np.maximum(common - gaussian_filter1d(common, RING_WIDTH_M / bin_m), 0.0)
    walls = float(np.median(smooth.max(axis=1)))
    ring[common > walls - RING_FAINT] = 0.0
    floor = gaussian_filter1d(np.percentile(smooth, 30.0, axis=0), 0.1 / bin_m)
    return np.asarray(smooth - floor - ring, dtype=np.float64)


def peaks_along(excess: NDArray[np.float64], scan: Scan, *, closed: bool) -> _Peaks:
    """Follow the contour, move to the first strong peak next to it, and judge each beam."""
    line = trace(excess, scan.bin_m, scan.step_rad, closed=closed)
    at = snap(excess, line.bins, scan.bin_m)
    rows = np.arange(len(at))
    level = excess[rows, at]
    range_m = (at + 0.5 + _between(excess, at)) * scan.bin_m
    around = np.median([np.roll(level, k) for k in (-2, -1, 0, 1, 2)], axis=0)
    bend = np.abs(np.roll(range_m, 1) - 2.0 * range_m + np.roll(range_m, -1))
    if not closed:
        bend[[0, -1]] = 0.0
    wide = (excess >= (level - COUNTS_6_DB)[:, None]).sum(axis=1) * scan.bin_m > WIDE_M
    heard = line.joined & (around > FAINT) & (bend < 2.0 * ROUGH_M)
    sure = heard & (bend < ROUGH_M) & ~wide
    sure &= long_enough(sure, range_m, scan.step_rad, closed=closed)
    return _Peaks(at, range_m, sure, heard & long_enough(heard, range_m, scan.step_rad, closed=closed))


def long_enough(
    sure: NDArray[np.bool_], range_m: NDArray[np.float64], step_rad: float, *, closed: bool
) -> NDArray[np.bool_]:
    """Whether a beam is in a run of sure beams along which a wall of ``SHORT_M`` is seen, ``(n,)``."""
    n = len(sure)
    if sure.all():
        return sure
    start = int(np.argmin(sure)) if closed else 0
    turned, length = np.roll(sure, -start), np.roll(range_m, -start)
    run = np.cumsum(np.diff(turned, prepend=False) != 0)
    chord = np.hypot(length * step_rad, np.abs(np.diff(length, prepend=length[:1])) * np.roll(turned, 1))
    total = np.bincount(run, np.where(turned, np.minimum(chord, 2.0 * ROUGH_M), 0.0), minlength=n + 1)
    return np.roll(turned & (total[run] >= SHORT_M), start)


def snap(excess: NDArray[np.float64], line: NDArray[np.intp], bin_m: float) -> NDArray[np.intp]:
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


def _between(excess: NDArray[np.float64], at: NDArray[np.intp]) -> NDArray[np.float64]:
    """Place of a peak between bins, by a parabola, -0.5 to 0.5."""
    rows, mid = np.arange(len(at)), np.clip(at, 1, excess.shape[1] - 2)
    left, top, right = excess[rows, mid - 1], excess[rows, mid], excess[rows, mid + 1]
    bend = np.minimum(left - 2.0 * top + right, -1e-9)
    return np.asarray(np.clip(0.5 * (left - right) / bend, -0.5, 0.5), dtype=np.float64)


def width_of(excess: NDArray[np.float64], at: NDArray[np.intp]) -> NDArray[np.float64]:
    """Width of the peaks at -6 dB, ``(n,)`` bins."""
    bins = np.arange(excess.shape[1])
    low = excess < (excess[np.arange(len(at)), at] - COUNTS_6_DB)[:, None]
    last = np.where(low & (bins > at[:, None]), bins, len(bins)).min(axis=1)
    first = np.where(low & (bins < at[:, None]), bins, -1).max(axis=1)
    return np.asarray(last - first - 1, dtype=np.float64)


def quiet_water(excess: NDArray[np.float64], peaks: _Peaks, scan: Scan, *, closed: bool) -> NDArray[np.float64]:
    """How far the water is open where a beam abstains: nothing was heard, and the walls on either side are farther.

    Silence alone does not prove open water: a smooth wall seen at a slant throws the sound away.
    """
    heard = excess > LOUD
    first = np.where(heard.any(axis=1), heard.argmax(axis=1), excess.shape[1]) * scan.bin_m
    wall = np.where(peaks.sure, peaks.range_m, np.nan)
    reach = max(1, int(NEIGHBOUR_RAD / scan.step_rad))
    sides = [_next_wall(wall[::way], reach, closed=closed)[::way] for way in (1, -1)]
    return np.asarray(np.minimum(first, np.minimum(*sides)) - 3.0 * SMOOTH_M, dtype=np.float64)


def _next_wall(wall: NDArray[np.float64], reach: int, *, closed: bool) -> NDArray[np.float64]:
    """Range of the last wall before each beam, ``(n,)``; 0 where there is none within ``reach`` beams."""
    n = len(wall)
    twice = np.concatenate([wall if closed else np.full(n, np.nan), wall])
    place = np.maximum.accumulate(np.where(np.isfinite(twice), np.arange(2 * n), -1))[n:]
    near = (place >= 0) & (np.arange(n, 2 * n) - place <= reach)
    return np.where(near, twice[np.maximum(place, 0)], 0.0)
