"""What is in the echoes and is no wall: ringing, noise, rings of constant range, side lobes, what goes on and on."""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

COUNTS_A_DB: Final = 255.0 / 80.0
_DECADE: Final = 10.0 * COUNTS_A_DB
SMOOTH_M: Final = 0.04
"""Smoothing along the range against speckle."""
LEAST_SHARE: Final = 0.35
"""A place where less than this is left beside the ringing is drawn down by what was taken out."""
RINGING_M: Final = 0.8
"""The transducer rings to here at most; what all bearings show alike within it is no echo."""
RINGING_EXCESS: Final = 18.0
"""Counts by which an echo must exceed what all bearings show within the zone of ringing ..."""
RINGING_NEAR: Final = 30.0
"""... and nearer than the least range."""
RINGING_LEVEL: Final = 40.0
RINGING_SHARE: Final = 35.0
"""Percentile over bearings that is common to all: a wall a hand's breadth away fills nearly half a circle."""
RING_WIDTH_M: Final = 0.4
"""What all bearings show at one range, narrower than this, is a side-lobe ring, a surface or a floor ..."""
RING_FAINT: Final = 20.0
"""... if it is fainter than the walls by these counts; in a round room the wall itself is such a ring."""
LOBE_DEG: Final = (5.0, 10.0, 20.0, 30.0, 45.0)
LOBE_DB: Final = (12.0, 14.0, 22.0, 30.0, 40.0)
"""How much fainter than a clear wall its side lobes are, by the angle from it."""
LOBE_MARGIN_DB: Final = 6.0
"""An echo this far above what side lobes can explain is no side lobe ..."""
LOBE_WEIGHT: Final = 0.5
"""... and one that they explain counts this much: it may be a faint wall all the same."""
LASTS_M: Final = (0.4, 2.0)
"""A wall is followed by its shadow: what is as loud so far behind, from and to, is floor, surface or fine dirt ..."""
LASTS_PERCENT: Final = 30
"""... but not what is loud here and there: further bounces."""
COARSE_M: Final = 0.1
EDGE_M: Final = 0.2
"""Behind the last bin it goes on as in so much before it."""


def without_ringing(echoes: NDArray[np.float64], bin_m: float, min_range_m: float) -> NDArray[np.float64]:
    """Echoes ``(n, bins)`` with what all bearings show near the head taken out."""
    clear = echoes.copy()
    zone = min(echoes.shape[1], math.ceil(RINGING_M / bin_m))
    near = clear[:, :zone]
    common = np.percentile(near, RINGING_SHARE, axis=0)
    alone = near + _DECADE * np.log10(np.maximum(1.0 - 10.0 ** ((common - near) / _DECADE), 1e-6))
    echo = np.where(common > RINGING_LEVEL, alone, near)
    least = np.where(np.arange(zone) < math.ceil(min_range_m / bin_m), RINGING_NEAR, RINGING_EXCESS)
    clear[:, :zone] = np.where(near > common + least, echo, 0.0)
    return clear


def deaf_m(echoes: NDArray[np.float64], bin_m: float) -> float:
    """Range up to which ringing hides all but the loudest echoes."""
    common = np.percentile(echoes[:, : math.ceil(RINGING_M / bin_m)], RINGING_SHARE, axis=0)
    return (float(np.max(np.flatnonzero(common > RINGING_LEVEL), initial=-1.0)) + 1.0) * bin_m


def smoothed(echoes: NDArray[np.float64], bin_m: float) -> NDArray[np.float64]:
    """Smooth echoes ``(n, bins)`` along the range, a thin wall within the ringing not into what was taken out."""
    sd, zone = SMOOTH_M / bin_m, min(echoes.shape[1], math.ceil(RINGING_M / bin_m))
    left = np.ones_like(echoes)
    left[:, :zone] = echoes[:, :zone] > 0.0
    share = gaussian_filter1d(left, sd, axis=1, mode="nearest")
    return np.asarray(gaussian_filter1d(echoes, sd, axis=1, mode="nearest") / np.maximum(share, LEAST_SHARE))


def floor_of(smooth: NDArray[np.float64], bin_m: float) -> NDArray[np.float64]:
    """Level of the noise at each range, ``(bins,)``: what most bearings show at least."""
    return np.asarray(gaussian_filter1d(np.percentile(smooth, 30.0, axis=0), 0.1 / bin_m), dtype=np.float64)


def rings_of(smooth: NDArray[np.float64], bin_m: float) -> NDArray[np.float64]:
    """Height of faint rings of constant range above what is beside them, ``(bins,)``."""
    common = np.median(smooth, axis=0)
    ring = np.maximum(common - gaussian_filter1d(common, RING_WIDTH_M / bin_m), 0.0)
    walls = float(np.median(smooth.max(axis=1)))
    ring[common > walls - RING_FAINT] = 0.0
    return np.asarray(ring, dtype=np.float64)


def lasting(smooth: NDArray[np.float64], floor: NDArray[np.float64], bin_m: float) -> NDArray[np.float64]:
    """Level ``(n, bins)`` above the floor of noise that each beam keeps up behind a place.

    Along a passage and over a wide floor a beam hears floor and surface from the range on at which it meets them: an
    edge that looks like a wall, goes with the vehicle, and has no shadow.
    """
    n, bins = smooth.shape
    coarse = max(1, round(COARSE_M / bin_m))
    first, last = (max(1, round(edge_m / (coarse * bin_m))) for edge_m in LASTS_M)
    edge = smooth[:, -max(1, round(EDGE_M / bin_m)) :].mean(axis=1, keepdims=True)
    count = math.ceil(bins / coarse)
    whole = np.concatenate([smooth, np.repeat(edge, (count + last) * coarse - bins, axis=1)], axis=1)
    behind = sliding_window_view(whole.reshape(n, -1, coarse).mean(axis=2), last - first + 1, axis=1)[:, first:]
    level = np.percentile(behind, LASTS_PERCENT, axis=2, method="lower")
    return np.maximum(np.repeat(level, coarse, axis=1)[:, :bins] - floor, 0.0)


def lobe_weights(smooth: NDArray[np.float64], step_rad: float, *, closed: bool) -> NDArray[np.float64]:
    """Weights ``(n, bins)`` of echoes: less than 1 where the side lobe of a louder one at its range explains it.

    A side lobe hears the clear wall beside the beam, at that wall's range: rings of constant range on either side.
    """
    loudest = np.full_like(smooth, -np.inf)
    n, reach = len(smooth), int(math.radians(LOBE_DEG[-1]) / step_rad)
    for k in range(math.ceil(math.radians(LOBE_DEG[0]) / step_rad), min(reach, n // 2) + 1):
        fainter = COUNTS_A_DB * float(np.interp(math.degrees(k * step_rad), LOBE_DEG, LOBE_DB))
        for way in (k, -k):
            beside = np.roll(smooth, way, axis=0) - fainter
            if not closed:
                beside[:k] = beside[:k] if way < 0 else -np.inf
                beside[n - k :] = beside[n - k :] if way > 0 else -np.inf
            np.maximum(loudest, beside, out=loudest)
    more = np.clip((smooth - loudest) / (LOBE_MARGIN_DB * COUNTS_A_DB), 0.0, 1.0)
    return np.asarray(LOBE_WEIGHT + (1.0 - LOBE_WEIGHT) * more, dtype=np.float64)
