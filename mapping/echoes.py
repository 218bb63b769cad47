"""From echoes to returns: where each beam sees the wall, or that it does not say.

What is no wall is taken out (``mapping.clutter``), a line is drawn through all beams (``mapping.contour``), and each
beam moves from the line to its first strong peak nearby (``mapping.peaks``).  Neighbouring beams then say together
where their wall is (``mapping.lines``).  A beam abstains rather than guess: where its echo is faint, and where the
line is broken.  Where the echo has no clear place along the range, as in corners, or the line is rough or short, the
return is vague: it has a large standard deviation.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from config.schema import Map
from mapping.between import NEIGHBOUR_RAD, Frame, Seen, continued_m, expected_m, faint_behind, peak_near, sides, veils
from mapping.clutter import SMOOTH_M, deaf_m, floor_of, lasting, lobe_weights, rings_of, smoothed, without_ringing
from mapping.contour import LOUD, trace
from mapping.lean import Line, late_m, nearer_m
from mapping.lines import Fit, fit_walls
from mapping.mirror import Heard, images
from mapping.peaks import centre_m, longer_m, snap, width_of
from mapping.values import Returns, Scan

FAINT: Final = 20.0
"""Counts above the floor, median of five beams along the line, below which a beam abstains."""
ROUGH_M: Final = 0.12
"""Second difference of the range from beam to beam beyond which a beam abstains."""
WIDE_M: Final = 0.35
"""A beam with more than this at the level of its peak, less 6 dB, has no clear place: a corner, or noise."""
OWN: Final = 0.9
"""An echo that side lobes of a louder one beside it explain nearly (``mapping.clutter``) may be no wall: a doorway's
edges close it with rings."""
SHORT_M: Final = 0.3
SHORT_RAD: Final = math.radians(45.0)
"""A wall of which less than this is seen without a break, in length and in angle, is no wall."""
PEAK_SD_M: Final = 0.012
"""Standard deviation of a wall met squarely ..."""
SLANT_SD: Final = 0.6
"""... and part of half its echo's length where it is met at a slant, which speckle moves it by."""
LATE_SD: Final = 0.25
"""... and of what the power of a leaning wall's echo is late."""
OFF_SD: Final = 3.0
"""A beam farther than this from the wall that its neighbours see is not of it."""
ON_SD_M: Final = 0.04
"""Standard deviation of a wall that goes on straight from where it is sure, as into a corner."""
VAGUE_SD_M: Final = 0.15
"""Least standard deviation of a vague return: it helps to place a scan, and draws no wall."""

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class Beams:
    """A scan's beams in order of bearing: ``echoes`` without ringing, and ``excess`` above all that is no wall.

    ``own`` ``(n, bins)`` is less than 1 where side lobes may explain an echo, and ``ended`` ``(n, bins)`` is ``excess``
    less what the beam keeps up behind (``mapping.clutter``).
    """

    bearing_rad: Floats
    echoes: Floats
    excess: Floats
    own: Floats
    ended: Floats
    floor: Floats
    bin_m: float
    step_rad: float
    closed: bool
    half_beam_rad: float
    half_height_rad: float
    deaf_m: float


@dataclass(frozen=True, slots=True)
class Peaks:
    """Per beam in order of bearing, ``(n,)`` each: bins, ranges, sds of the peaks, which are sure and which heard.

    ``expected_m`` is where the walls beside a beam would meet it, nan where there are none.
    """

    bins: NDArray[np.intp]
    range_m: Floats
    sd_m: Floats
    sure: Flags
    heard: Flags
    expected_m: Floats


@dataclass(frozen=True, slots=True)
class Measured:
    """Ranges at peaks, ``(n,)`` each, before beams are settled onto the walls of ``fit``."""

    range_m: Floats
    heard: Flags
    sure: Flags
    fit: Fit
    sd_m: Floats


def pick(scan: Scan, config: Map) -> Returns:
    """Find the wall return of each beam of a scan."""
    n, bins = scan.echoes.shape
    if n < 5 or bins < 16:
        return Returns(np.full(n, np.nan), np.full(n, np.nan), np.zeros(n))
    order, closed = in_order(scan)
    beams = beams_of(scan, order, config, closed=closed)
    if scan.quality == "moving":  # what corners keep up changes from place to place, but edges go with the vehicle
        beams = replace(beams, excess=beams.ended)
    peaks = peaks_along(beams)
    free_m = np.where(peaks.sure, peaks.range_m, quiet_water(beams, peaks))
    back = np.empty(n, dtype=np.intp)
    back[order] = np.arange(n)
    offset = config.range_offset_m
    range_m = np.where(peaks.heard, np.maximum(peaks.range_m + offset, 0.0), np.nan)
    return Returns(
        range_m[back], np.where(peaks.heard, peaks.sd_m, np.nan)[back], np.maximum(free_m + offset, 0.0)[back]
    )


def in_order(scan: Scan) -> tuple[NDArray[np.intp], bool]:
    """Order of the beams by bearing, a sector's from its one end to the other; and whether they close a circle."""
    bearing = scan.bearing_rad % (2.0 * math.pi)
    order = np.argsort(bearing, kind="stable")
    gaps = np.diff(bearing[order], append=bearing[order[0]] + 2.0 * math.pi)
    widest = int(np.argmax(gaps))
    if gaps[widest] <= 4.0 * scan.step_rad:
        return order, True
    return np.roll(order, -(widest + 1)), False


def beams_of(scan: Scan, order: NDArray[np.intp], config: Map, *, closed: bool) -> Beams:
    """Take out of a scan's echoes what is no wall."""
    raw = scan.echoes[order].astype(np.float64)
    echoes = without_ringing(raw, scan.bin_m, config.min_range_m)
    smooth = smoothed(echoes, scan.bin_m)
    floor = floor_of(smooth, scan.bin_m)
    excess = smooth - floor - rings_of(smooth, scan.bin_m)
    own = lobe_weights(smooth, scan.step_rad, closed=closed)
    excess = np.where(excess > 0.0, excess * own, excess)
    ended = np.minimum(excess, np.maximum(excess - lasting(smooth, floor, scan.bin_m), 0.0))
    bearing, deaf = scan.bearing_rad[order], deaf_m(raw, scan.bin_m)
    width, height = math.radians(config.beam_deg) / 2.0, math.radians(config.beam_vertical_deg) / 2.0
    return Beams(bearing, echoes, excess, own, ended, floor, scan.bin_m, scan.step_rad, closed, width, height, deaf)


def peaks_along(beams: Beams) -> Peaks:
    """Follow the contour, move to the first strong peak next to it, and judge each beam."""
    excess, bin_m, step, closed = beams.excess, beams.bin_m, beams.step_rad, beams.closed
    line = trace(excess, bin_m, step, closed=closed)
    # Where the line has no shadow behind it, it is the edge of what floor and surface send back, and no wall.
    goes_on = middle_of_five(beams.ended[np.arange(len(line.bins)), line.bins]) < FAINT
    if goes_on.any():
        excess = np.where(goes_on[:, None], beams.ended, excess)
        beams = replace(beams, excess=excess)
        line = trace(excess, bin_m, step, closed=closed)
    if closed:
        weights = veils(excess, line.bins, bin_m, step)
        if weights.min() < 1.0:
            beams = replace(beams, excess=excess * weights)
            line = trace(beams.excess, bin_m, step, closed=closed)
    at = snap(beams.excess, line.bins, bin_m)
    found = measure(beams, at, line.joined, np.zeros(len(at)), np.zeros(len(at)))
    seen = Line(found.range_m, found.heard, found.fit.slope)
    late = late_m(beams.echoes, beams.floor, bin_m, seen, beams.half_beam_rad)
    if late.any():
        found = measure(beams, at, line.joined, late, nearer_m(seen, late))
    return settle(beams, Peaks(at, found.range_m, found.sd_m, found.sure, found.heard, found.range_m), found.fit)


def measure(beams: Beams, at: NDArray[np.intp], joined: Flags, late: Floats, nearer: Floats) -> Measured:
    """Measure ranges at the peaks ``at``, of walls whose echoes are ``late`` and ``nearer`` for their lean."""
    centre = centre_m(beams.echoes, beams.floor, at, beams.bin_m, late)
    range_m = centre - longer_m(centre, beams.half_height_rad, late) + nearer
    heard, sure = judge(beams, at, range_m, joined, late)
    fit, sd_m = walls_of(beams, range_m, heard, late)
    return Measured(range_m, heard, sure, fit, sd_m)


def judge(beams: Beams, at: NDArray[np.intp], range_m: Floats, joined: Flags, late: Floats) -> tuple[Flags, Flags]:
    """Tell which beams are heard, and which of them have a clear place on a line that goes on."""
    level = beams.excess[np.arange(len(at)), at]
    around = middle_of_five(level)
    bend = np.abs(np.roll(range_m, 1) - 2.0 * range_m + np.roll(range_m, -1)) * squareness(beams, range_m)
    if not beams.closed:
        bend[[0, -1]] = 0.0
    wide = width_of(beams.excess, at) * beams.bin_m > WIDE_M + 2.0 * late
    heard = joined & (around > FAINT) & (bend < 2.0 * ROUGH_M + late)
    sure = heard & (bend < ROUGH_M + late) & ~wide & ~of_lobes(beams, at)
    sure &= long_enough(sure, range_m, beams.step_rad, closed=beams.closed)
    return heard & long_enough(heard, range_m, beams.step_rad, closed=beams.closed), sure


def of_lobes(beams: Beams, at: NDArray[np.intp]) -> Flags:
    """Whether side lobes explain the echoes at the bins ``at``, ``(n,)``; within the ringing nothing tells."""
    return np.asarray((beams.own[np.arange(len(at)), at] < OWN) & ((at + 0.5) * beams.bin_m > beams.deaf_m))


def middle_of_five(level: Floats) -> Floats:
    """Median ``(n,)`` of each beam's level and those of two beams on either side."""
    return np.asarray(np.median([np.roll(level, k) for k in (-2, -1, 0, 1, 2)], axis=0))


def squareness(beams: Beams, range_m: Floats) -> Floats:
    """Cosine ``(n,)`` of the incidence at which a line is met: errors along the range move a wall less at a slant."""
    after = np.diff(range_m, append=range_m[0] if beams.closed else range_m[-1]) / beams.step_rad
    before = np.roll(after, 1)
    slope = np.where(after * before > 0.0, np.minimum(np.abs(after), np.abs(before)), 0.0)
    return np.asarray(range_m / np.maximum(np.hypot(range_m, slope), 1e-6))


def walls_of(beams: Beams, range_m: Floats, heard: Flags, late: Floats) -> tuple[Fit, Floats]:
    """Fit walls to the beams that are heard; give each beam's own standard deviation, which grows with the slant."""
    seen = np.where(heard, range_m, np.nan)
    sd_m = np.full(len(seen), 2.0 * PEAK_SD_M)
    for _ in range(2):
        fit = fit_walls(beams.bearing_rad, seen, sd_m, beams.step_rad, closed=beams.closed)
        slope = np.where(np.isfinite(fit.slope), np.abs(fit.slope), 1.0)
        sd_m = np.hypot(PEAK_SD_M + LATE_SD * late, SLANT_SD * slope * beams.half_beam_rad)
    return fit, sd_m


def settle(beams: Beams, peaks: Peaks, fit: Fit) -> Peaks:
    """Put sure beams onto their walls; let beams beside them look where those walls would be."""
    of_wall = peaks.sure & (np.abs(fit.range_m - peaks.range_m) < OFF_SD * peaks.sd_m + beams.bin_m)
    of_wall &= ~images(
        beams.bearing_rad, fit.range_m, fit.wall, of_wall, Heard(beams.excess, beams.bin_m, beams.deaf_m)
    )
    level = beams.excess[np.arange(len(peaks.bins)), peaks.bins]
    seen = Seen(beams.bearing_rad, peaks.range_m, level)
    of_wall &= ~faint_behind(seen, of_wall, fit.wall, beams.step_rad, closed=beams.closed)
    range_m = np.where(of_wall, fit.range_m, peaks.range_m)
    sd_m = np.where(of_wall, fit.sd_m, np.maximum(peaks.sd_m, VAGUE_SD_M))
    frame = Frame(beams.bin_m, beams.step_rad, beams.closed, (peaks.bins + 0.5) * beams.bin_m - peaks.range_m)
    seen = replace(seen, range_m=range_m)
    on_m = continued_m(seen, beams.excess, of_wall, fit.wall, frame)
    goes_on = np.isfinite(on_m)
    range_m, sd_m = np.where(goes_on, on_m, range_m), np.where(goes_on, ON_SD_M, sd_m)
    peaks = replace(peaks, heard=peaks.heard | goes_on)
    expected = expected_m(beams.bearing_rad, fit.wall, of_wall, beams.step_rad, closed=beams.closed)
    of_wall = of_wall | goes_on
    return replace(peaks, range_m=range_m, sd_m=sd_m, sure=of_wall, expected_m=expected)


def answers_m(beams: Beams, peaks: Peaks) -> Floats:
    """Range ``(n,)`` that each beam would tell if it had to: beside the walls, the peak nearest to where they lead."""
    at = peak_near(beams.excess, np.where(peaks.sure, np.nan, peaks.expected_m), beams.bin_m)
    return np.where(at >= 0, (at + 0.5) * beams.bin_m, peaks.range_m)


def long_enough(sure: Flags, range_m: Floats, step_rad: float, *, closed: bool) -> Flags:
    """Whether a beam is in a run of sure beams along which enough of a wall is seen, ``(n,)``."""
    n = len(sure)
    if sure.all():
        return sure
    start = int(np.argmin(sure)) if closed else 0
    turned, length = np.roll(sure, -start), np.roll(range_m, -start)
    run = np.cumsum(np.diff(turned, prepend=False) != 0)
    chord = np.hypot(length * step_rad, np.abs(np.diff(length, prepend=length[:1])) * np.roll(turned, 1))
    total = np.bincount(run, np.where(turned, np.minimum(chord, 2.0 * ROUGH_M), 0.0), minlength=n + 1)
    return np.roll(turned & (total[run] >= np.minimum(SHORT_M, SHORT_RAD * length)), start)


def quiet_water(beams: Beams, peaks: Peaks) -> Floats:
    """How far the water is open where a beam abstains: nothing was heard, and the walls on either side are farther.

    Silence alone does not prove open water: a smooth wall seen at a slant throws the sound away, and what is heard
    late may have come by way of it.  So nothing is said behind the lines of the walls on either side.
    """
    heard = beams.excess > LOUD
    first = np.where(heard.any(axis=1), heard.argmax(axis=1), beams.excess.shape[1]) * beams.bin_m
    reach = max(1, int(NEIGHBOUR_RAD / beams.step_rad))
    walls = [np.where(side >= 0, peaks.range_m[side], 0.0) for side in sides(peaks.sure, reach, closed=beams.closed)]
    return np.asarray(
        np.fmin(np.minimum(first, np.minimum(*walls)), peaks.expected_m) - 3.0 * SMOOTH_M, dtype=np.float64
    )
