"""The wall as one line through all beams: the eye's way of reading a sonar picture.

A beam alone cannot tell an oblique wall from noise, nor a wall from the second bounce behind it.  Over bearing the
wall is a line that hardly jumps, with quiet water before it.  Dynamic programming finds the line of most echo, less
what it costs to pass through echoes, to slope and to jump.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

CAP = 120.0
"""Counts above the floor beyond which an echo is no more of a wall."""
NEED = 12.0
"""Counts above the floor below which a place speaks against a wall."""
LOUD = 22.0
"""Counts above the floor from which an echo stands in the way of what lies behind it."""
LOUD_CAP = 30.0
LOUD_COST = 0.3
"""Cost of passing a loud echo, per count and 10 cm ..."""
PASS_COST = 40.0
"""... and at most: ringing and floating things are passed."""
PASS_GAP_M = 0.12
"""A wall's own leading edge does not stand in its way."""
SLOPE_COST = 3.0
"""Per unit of the tangent of the incidence."""
STEEPEST = 4.5
"""Tangent of incidence, 77 degrees, beyond which a line is a jump."""
JUMP_COST = 80.0
WIDEST_BINS = 30


@dataclass(frozen=True, slots=True)
class Contour:
    """The line: ``bins`` ``(n,)`` per beam; ``joined`` ``(n,)`` whether it runs on without a jump on both sides."""

    bins: NDArray[np.intp]
    joined: NDArray[np.bool_]


def trace(excess: NDArray[np.float64], bin_m: float, step_rad: float, *, closed: bool) -> Contour:
    """Find the line through echoes ``(n, bins)`` in counts above the floor, beams in order of bearing.

    A closed circle is gone through twice, so that its seam is like any other place.
    """
    n = len(excess)
    reward = _reward(excess, bin_m)
    if closed:
        reward = np.concatenate([reward, reward])
    line = _best_line(reward, _slope_costs(excess.shape[1], bin_m, step_rad))
    if closed:
        half = n // 2
        line = np.roll(line[half : half + n], half)
    range_m = (line + 0.5) * bin_m
    limit = np.maximum(2.5 * bin_m, STEEPEST * step_rad * range_m)
    after = np.abs(np.roll(range_m, -1) - range_m) <= limit
    before = np.abs(np.roll(range_m, 1) - range_m) <= limit
    if not closed:
        after[-1], before[0] = True, True
    return Contour(line, after & before)


def _reward(excess: NDArray[np.float64], bin_m: float) -> NDArray[np.float64]:
    """Gain of each place as the wall: its echo, less the echoes passed on the way."""
    loud = np.clip(excess - LOUD, 0.0, LOUD_CAP) * (bin_m / 0.1)
    gap = max(1, round(PASS_GAP_M / bin_m))
    passed = np.zeros_like(excess)
    passed[:, gap:] = np.cumsum(loud, axis=1)[:, :-gap]
    return np.clip(excess, 0.0, CAP) - NEED - np.minimum(LOUD_COST * passed, PASS_COST)


def _slope_costs(bins: int, bin_m: float, step_rad: float) -> NDArray[np.float64]:
    """Cost ``(2 w + 1, bins)`` of coming from ``w`` bins nearer to ``w`` bins farther, per bin arrived at."""
    arc = (np.arange(bins) + 0.5) * bin_m * step_rad
    widest = min(WIDEST_BINS, max(2, math.ceil(STEEPEST * float(arc[-1]) / bin_m)))
    moves = np.abs(np.arange(-widest, widest + 1))[:, None]
    slope = moves * bin_m / arc[None, :]
    cost = np.where(moves <= 1, 0.0, SLOPE_COST * slope)
    return np.where((moves > 1) & (slope > STEEPEST), np.inf, cost)


def _best_line(reward: NDArray[np.float64], costs: NDArray[np.float64]) -> NDArray[np.intp]:
    """Viterbi's path of most reward, ``(n,)`` bins."""
    n, bins = reward.shape
    widest = len(costs) // 2
    origin = np.zeros((n, bins), dtype=np.intp)
    padded = np.full(bins + 2 * widest, -np.inf)
    value = reward[0].copy()
    here = np.arange(bins)
    for t in range(1, n):
        padded[widest : widest + bins] = value
        arrivals = np.lib.stride_tricks.sliding_window_view(padded, bins) - costs
        move = arrivals.argmax(axis=0)
        best = arrivals[move, here]
        top = int(value.argmax())
        jumps = value[top] - JUMP_COST > best
        origin[t] = np.where(jumps, top, here + move - widest)
        value = np.where(jumps, value[top] - JUMP_COST, best) + reward[t]
    line = np.empty(n, dtype=np.intp)
    line[-1] = int(value.argmax())
    for t in range(n - 1, 0, -1):
        line[t - 1] = origin[t, line[t]]
    return line
