"""Between the walls that are sure: what they lead to expect, and what stands before them without hiding them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from mapping.clutter import COUNTS_A_DB

OPENING_RAD: Final = math.radians(40.0)
"""A stretch wider than this is no glimpse through an opening, but a part of the room ..."""
FAINT_BEHIND: Final = 10.0 * COUNTS_A_DB
"""... and a narrower one behind the walls beside it, fainter than walls usually are by this, is none."""
BREAK_M: Final = 0.15
BREAK_SLOPE: Final = 3.0
NEIGHBOUR_RAD: Final = math.radians(30.0)
"""Walls seen within this on either side say something about a beam."""
NEAR_M: Final = 0.2
"""An echo this far from where the walls meet may be of them ..."""
DRAW: Final = 25.0
"""... less likely by these counts at half of that."""
LEAST: Final = 25.0
BEFORE_M: Final = 0.3
"""What is nearer than the wall on both sides by this stands before it."""
WIDEST_RAD: Final = math.radians(30.0)
AS_LOUD: Final = 8.0 * COUNTS_A_DB
"""A wall that is no fainter than beside by more than this is not hidden."""
ON_M: Final = 0.4
"""A wall may go on straight so far from where it is sure ..."""
BESIDE_M: Final = 0.06
"""... in beams that have an echo within this of its line ..."""
ASIDE_M: Final = 0.12
"""... and of which the line through the beams lies within this of it."""
LEAST_SQUARE: Final = 0.6
"""... both across the wall, which is met at no more of a slant than this cosine of incidence."""
FIRM_OF: Final = 4
FIRM_LEAST: Final = 3
FIRM_M: Final = 0.04
"""A wall is firm where so many of so many beams on one side see it within this."""

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Frame:
    """Bin and step of beams, whether they close a circle, and how far each one's peak is behind its wall, ``(n,)``."""

    bin_m: float
    step_rad: float
    closed: bool
    longer_m: Floats


@dataclass(frozen=True, slots=True)
class Seen:
    """Beams in order of bearing, ``(n,)`` each: direction, range and level (counts above the floor) of their peaks."""

    bearing_rad: Floats
    range_m: Floats
    level: Floats


def sides(sure: NDArray[np.bool_], reach: int, *, closed: bool) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Index of the last sure beam up to each and of the next from each on, ``(n,)``; -1 where none is within reach."""
    n = len(sure)
    before = _last(sure, reach, closed=closed)
    after = _last(sure[::-1], reach, closed=closed)[::-1]
    return before, np.where(after >= 0, n - 1 - after, -1)


def _last(sure: NDArray[np.bool_], reach: int, *, closed: bool) -> NDArray[np.intp]:
    n = len(sure)
    twice = np.concatenate([sure if closed else np.zeros(n, dtype=bool), sure])
    place = np.maximum.accumulate(np.where(twice, np.arange(2 * n), -1))[n:]
    near = (place >= 0) & (np.arange(n, 2 * n) - place <= reach)
    return np.where(near, place % n, -1)


def expected_m(bearing_rad: Floats, wall: Floats, sure: NDArray[np.bool_], step_rad: float, *, closed: bool) -> Floats:
    """Range ``(n,)`` at which a beam meets the nearer of the straight walls on either side; nan without any.

    ``wall`` ``(n, 2)`` are the sure beams' walls as in ``mapping.lines``.
    """
    nearest = np.full(len(sure), np.inf)
    for side in sides(sure, max(1, int(NEIGHBOUR_RAD / step_rad)), closed=closed):
        inverse = wall[side, 0] * np.sin(bearing_rad) + wall[side, 1] * np.cos(bearing_rad)
        with np.errstate(divide="ignore", invalid="ignore"):
            met = np.where((side >= 0) & (inverse > 0.0), 1.0 / inverse, np.inf)
        nearest = np.fmin(nearest, met)
    return np.where(np.isfinite(nearest), nearest, np.nan)


def continued_m(seen: Seen, excess: Floats, sure: NDArray[np.bool_], wall: Floats, frame: Frame) -> Floats:
    """Range ``(n,)`` of unsure beams in which the wall beside them goes on, nan elsewhere.

    Straight on from the last firm beam on one side, for ``ON_M`` at most and not behind the wall on the other side; the
    beam has an echo there.  Where its own line lies elsewhere, through an opening, the wall does not go on.
    """
    base = firm(seen, sure, wall, closed=frame.closed)
    inner = expected_m(seen.bearing_rad, wall, base, frame.step_rad, closed=frame.closed) + BESIDE_M
    found, nearest = np.full(len(sure), np.nan), np.full(len(sure), ON_M)
    for side in sides(base, max(1, int(NEIGHBOUR_RAD / frame.step_rad)), closed=frame.closed):
        inverse = wall[side, 0] * np.sin(seen.bearing_rad) + wall[side, 1] * np.cos(seen.bearing_rad)
        with np.errstate(divide="ignore", invalid="ignore"):
            met = np.where((side >= 0) & (inverse > 0.0) & ~sure, 1.0 / inverse, np.nan)
        at = peak_near(excess, met, frame.bin_m)
        there = np.where(at >= 0, (at + 0.5) * frame.bin_m - frame.longer_m, np.nan)
        base_m, turn = seen.range_m[side], seen.bearing_rad - seen.bearing_rad[side]
        apart = np.hypot(met * np.sin(turn), met * np.cos(turn) - base_m)
        square = np.maximum(met_square(seen.bearing_rad, wall[side]), LEAST_SQUARE)
        on = (
            (np.abs(there - met) * square < BESIDE_M)
            & (np.abs(seen.range_m - met) * square < ASIDE_M)
            & (met < inner)
            & (apart < nearest)
        )
        found, nearest = np.where(on, met, found), np.where(on, apart, nearest)
    return found


def met_square(bearing_rad: Floats, wall: Floats) -> Floats:
    """Cosine ``(n,)`` of the incidence at which beams meet walls ``(n, 2)``."""
    towards = wall[:, 0] * np.sin(bearing_rad) + wall[:, 1] * np.cos(bearing_rad)
    return np.asarray(towards / np.maximum(np.hypot(wall[:, 0], wall[:, 1]), 1e-9))


def firm(seen: Seen, sure: NDArray[np.bool_], wall: Floats, *, closed: bool) -> NDArray[np.bool_]:
    """Whether sure beams' walls are also their neighbours' on one side, ``(n,)``: a corner's flash is not."""
    agree = np.zeros((2, len(sure)), dtype=np.intp)
    for k in range(1, FIRM_OF + 1):
        for way, step in enumerate((k, -k)):
            bearing = np.roll(seen.bearing_rad, step)
            inverse = wall[:, 0] * np.sin(bearing) + wall[:, 1] * np.cos(bearing)
            with np.errstate(divide="ignore", invalid="ignore"):
                same = np.roll(sure, step) & (np.abs(1.0 / inverse - np.roll(seen.range_m, step)) < FIRM_M)
            if not closed:
                same[(slice(None, k), slice(len(sure) - k, None))[way]] = False
            agree[way] += same
    return np.asarray(sure & (agree.max(axis=0) >= FIRM_LEAST))


def faint_behind(
    beams: Seen, sure: NDArray[np.bool_], wall: Floats, step_rad: float, *, closed: bool
) -> NDArray[np.bool_]:
    """Tell which sure beams are faint and behind the lines of the walls beside them, ``(n,)``.

    Through an opening a far wall answers clearly; what comes by way of a bounce, past a wall met at a slant that
    itself is silent, is fainter than walls are.
    """
    told = np.zeros(len(sure), dtype=bool)
    if not sure.any():
        return told
    least = float(np.median(beams.level[sure])) - FAINT_BEHIND
    for run in _runs(beams.range_m, sure, step_rad, closed=closed):
        if len(run) * step_rad > OPENING_RAD or float(beams.level[run].mean()) > least:
            continue
        others = sure.copy()
        others[run] = False
        line = expected_m(beams.bearing_rad, wall, others, step_rad, closed=closed)[run]
        told[run] = bool(np.median(beams.range_m[run] - line) > BEFORE_M)
    return told


def _runs(range_m: Floats, sure: NDArray[np.bool_], step_rad: float, *, closed: bool) -> list[NDArray[np.intp]]:
    """Beams in a row that are sure and of one wall."""
    before = np.roll(range_m, 1)
    breaks = ~(sure & np.roll(sure, 1)) | (
        np.abs(range_m - before) > np.maximum(BREAK_M, BREAK_SLOPE * step_rad * before)
    )
    breaks[0] |= not closed
    start = int(np.argmax(breaks))
    order = np.roll(np.arange(len(sure)), -start)
    pieces = np.split(order, np.flatnonzero(breaks[order])[1:])
    return [piece[sure[piece]] for piece in pieces if sure[piece].any()]


def peak_near(excess: Floats, where_m: Floats, bin_m: float) -> NDArray[np.intp]:
    """Bin of the local peak that fits best to a place in each beam, ``(n,)``; -1 where there is none."""
    n, bins = excess.shape
    reach = max(1, round(NEAR_M / bin_m))
    middle = np.where(np.isfinite(where_m), where_m / bin_m - 0.5, -2.0 * reach - 1.0)
    at = np.rint(middle).astype(np.intp)[:, None] + np.arange(-reach, reach + 1)
    inside = (at >= 1) & (at < bins - 1)
    at = np.clip(at, 1, bins - 2)
    here, left, right = (np.take_along_axis(excess, at + k, axis=1) for k in (0, -1, 1))
    off = (at - middle[:, None]) * bin_m / (0.5 * NEAR_M)
    peak = inside & (here >= left) & (here >= right) & (here > LEAST)
    score = np.where(peak, here - DRAW * off**2, -np.inf)
    best = score.argmax(axis=1)
    rows = np.arange(n)
    return np.where(score[rows, best] > 0.0, at[rows, best], -1)


def veils(excess: Floats, bins: NDArray[np.intp], bin_m: float, step_rad: float) -> Floats:
    """Weights ``(n, bins)``, 0 where a narrow thing stands before a wall without hiding it, 1 elsewhere.

    Such a thing lies between two jumps of the line through the beams of a circle, nearer than what is beside it; the
    wall goes on behind it as loud as beside.  A body that is wider than the beam would throw a shadow.
    """
    n = len(bins)
    weights = np.ones_like(excess)
    range_m = (bins + 0.5) * bin_m
    jumps = np.diff(range_m, append=range_m[0])
    begins, ends = np.flatnonzero(jumps < -BEFORE_M), np.flatnonzero(jumps > BEFORE_M)
    for begin in begins:
        width = int(((ends - begin) % n).min(initial=n))
        if not 0 < width * step_rad <= WIDEST_RAD:
            continue
        beams = (begin + 1 + np.arange(width)) % n
        flanks = np.array([begin, (begin + width + 1) % n])
        share = np.arange(1, width + 1) / (width + 1)
        behind = 1.0 / ((1.0 - share) / range_m[flanks[0]] + share / range_m[flanks[1]])
        if (
            _loudest(excess, beams, behind, bin_m).mean()
            < _loudest(excess, flanks, range_m[flanks], bin_m).mean() - AS_LOUD
        ):
            continue
        for beam, wall_m in zip(beams, behind, strict=True):
            weights[beam, : max(0, int((wall_m - BEFORE_M) / bin_m))] = 0.0
    return weights


def _loudest(excess: Floats, beams: NDArray[np.intp], where_m: Floats, bin_m: float) -> Floats:
    at = (where_m / bin_m).astype(np.intp)[:, None] + np.arange(-round(NEAR_M / bin_m), round(NEAR_M / bin_m) + 1)
    return np.asarray(excess[beams[:, None], np.clip(at, 0, excess.shape[1] - 1)].max(axis=1), dtype=np.float64)
