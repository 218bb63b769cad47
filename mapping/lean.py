"""Walls that lean: in wells and caves the first echo of a wall comes from above or below the level of the sonar.

A beam is high.  An upright wall answers at its range, with a short tail from off the level.  A wall that leans, either
way, is met squarely at an elevation: its echo begins there, nearer than the wall is at the sonar's own level, and goes
on beyond it.  The lean is told by how much later than its front an echo's power lies, as neighbouring beams show it
together: speckle makes one beam's echo ragged.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from mapping.clutter import COUNTS_A_DB

BACK_M: Final = 0.3
ON_M: Final = 0.9
"""Echoes are looked at from so far before to so far behind the line."""
PEAK_M: Final = 0.3
"""The wall's own peak is within this behind the line."""
TOGETHER: Final = 8
"""Beams on either side whose echoes are taken together ..."""
ALIKE: Final = 0.25
"""... if their ranges differ by no more than this share."""
FEWEST: Final = 5
AMONG: Final = 25
"""Beams on either side of which the median counts: corners are late too, but few."""
END: Final = 0.1
FRONT: Final = 0.25
"""Shares of the peak's power down to which an echo reaches, and at which its front is."""
UPRIGHT_M: Final = 0.06
"""An upright wall's power lies no farther than this behind its front."""
LEAST_SHARE: Final = 0.3
"""Walls lean all round, or nearly: what is late in fewer beams is a corner, or a shelf."""
SHIFT: Final = 0.035
SHIFT_LATE: Final = 0.03
"""The centre of a leaning wall's echo is nearer than an upright one's by up to ``SHIFT`` of the range, more the later
its power lies, in shares of the range too: measured on two emulators of different makers."""
SLANT_POWER: Final = 3.0
"""At a slant a wall sends little from where it is met squarely: the shift falls with the squared cosine so often."""
SLANTEST: Final = 1.2
"""Tangent of incidence beyond which an echo is too long by its slant to tell its lean."""
_DECADE: Final = 10.0 * COUNTS_A_DB
_NOISE: Final = 1.5 * COUNTS_A_DB

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class Line:
    """The line through the beams in order of bearing, ``(n,)`` each: range, whether heard, change of range per radian.

    ``slope`` is nan where it is not known.
    """

    range_m: Floats
    heard: Flags
    slope: Floats


def late_m(echoes: Floats, floor: Floats, bin_m: float, line: Line, half_beam_rad: float) -> Floats:
    """By how much later than their fronts the power of walls' echoes lies, ``(n,)``; 0 where walls are upright.

    ``echoes`` ``(n, bins)`` and ``floor`` ``(bins,)`` are in counts.
    """
    mean, back = _together(echoes, floor, bin_m, line)
    offset_m = (np.arange(mean.shape[1]) - back + 0.5) * bin_m
    column = np.arange(mean.shape[1])
    own = mean[:, : back + max(1, round(PEAK_M / bin_m))]
    top, peak = own.max(axis=1, keepdims=True), own.argmax(axis=1)[:, None]
    low = mean < END * top
    end = np.where(low & (column > peak), column, mean.shape[1]).min(axis=1, keepdims=True)
    begin = np.where(low & (column < peak), column, -1).max(axis=1, keepdims=True) + 1
    front = np.where((mean >= FRONT * top) & (column >= begin), column, mean.shape[1] - 1).min(axis=1)
    power = np.where((column >= begin) & (column < end), mean, 0.0)
    centre = (power * offset_m).sum(axis=1) / np.maximum(power.sum(axis=1), 1e-9)
    slope = np.abs(line.slope)
    late = centre - offset_m[front] - half_beam_rad * np.nan_to_num(slope)
    told = line.heard & (top[:, 0] > 0.0) & (slope < SLANTEST * line.range_m)
    usual = _median_beside(np.where(told, late, np.nan))
    leans = usual > UPRIGHT_M
    if leans.sum() < LEAST_SHARE * len(leans):
        return np.zeros(len(leans))
    return np.sqrt(np.where(leans, usual**2 - UPRIGHT_M**2, 0.0))


def nearer_m(line: Line, late: Floats) -> Floats:
    """By how much nearer the centres of echoes are for the lean of their walls, ``(n,)``; less at a slant."""
    range_m = np.maximum(line.range_m, 0.1)
    slant = (1.0 + (np.nan_to_num(line.slope) / range_m) ** 2) ** SLANT_POWER
    return np.asarray(SHIFT * range_m * (1.0 - np.exp(-late / (SHIFT_LATE * range_m))) / slant)


def _together(echoes: Floats, floor: Floats, bin_m: float, line: Line) -> tuple[Floats, int]:
    """Mean power of neighbouring beams along their lines, ``(n, k)``, each beam's own peak 1; and the line's column."""
    n, bins = echoes.shape
    back, on = round(BACK_M / bin_m), round(ON_M / bin_m)
    at = (line.range_m / bin_m).astype(np.intp)[:, None] + np.arange(-back, on + 1)
    inside = (at >= 0) & (at < bins)
    at = np.clip(at, 0, bins - 1)
    noise = 10.0 ** ((floor + _NOISE) / _DECADE)
    power = np.maximum(10.0 ** (np.take_along_axis(echoes, at, axis=1) / _DECADE) - noise[at], 0.0) * inside
    power /= np.maximum(power[:, : back + max(1, round(PEAK_M / bin_m))].max(axis=1, keepdims=True), 1.0)
    total, count = np.zeros_like(power), np.zeros(n)
    for k in range(-TOGETHER, TOGETHER + 1):
        beside = np.roll(line.range_m, k)
        alike = np.roll(line.heard, k) & (np.abs(beside - line.range_m) < ALIKE * line.range_m)
        total += np.roll(power, k, axis=0) * alike[:, None]
        count += alike
    return np.where(count[:, None] >= FEWEST, total / np.maximum(count, 1.0)[:, None], 0.0), back


def _median_beside(value: Floats) -> Floats:
    """Median ``(n,)`` over each beam's neighbours that tell; 0 where fewer than ``FEWEST`` do."""
    beside = np.stack([np.roll(value, k) for k in range(-AMONG, AMONG + 1)])
    count = np.isfinite(beside).sum(axis=0)
    ordered = np.sort(beside, axis=0)
    middle = np.take_along_axis(ordered, np.maximum((count - 1) // 2, 0)[None, :], axis=0)[0]
    return np.where(count >= FEWEST, middle, 0.0)
