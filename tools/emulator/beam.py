"""The beam of a Micron-class head, 3 x 35 degrees, and how echoes spread over range.

Angles in radians.  Patterns are two-way power, so -6 dB where the beam is stated to be wide.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

WIDTH_DEG: Final = 3.0
HEIGHT_DEG: Final = 35.0
PULSE_M: Final = 0.018
"""Length of a compressed pulse in range."""

# Two-way skirts and side lobes beside the main lobe's peak: degrees off the axis, dB.
_LOBES_DEG: Final = (0.0, 3.0, 5.0, 10.0, 20.0, 30.0, 45.0, 180.0)
_LOBES_DB: Final = (-9.0, -11.0, -15.0, -19.0, -28.0, -42.0, -54.0, -60.0)
_RIPPLE_DEG: Final = 4.3


def horizontal(offset_rad: Floats) -> Floats:
    """Two-way power of the pattern beside its peak, over the angle from the beam's axis."""
    degrees = np.abs(np.degrees((offset_rad + np.pi) % (2.0 * np.pi) - np.pi))
    main_db = -6.0 * (degrees / (WIDTH_DEG / 2.0)) ** 2
    lobes_db = np.interp(degrees, _LOBES_DEG, _LOBES_DB) + 1.5 * np.cos(degrees * (2.0 * np.pi / _RIPPLE_DEG))
    return np.asarray(10.0 ** (np.maximum(main_db, lobes_db) / 10.0), dtype=np.float64)


def vertical(elevation_rad: Floats) -> Floats:
    """Two-way power of the pattern over the angle from the horizontal."""
    return np.asarray(10.0 ** (-0.6 * (np.degrees(elevation_rad) / (HEIGHT_DEG / 2.0)) ** 2), dtype=np.float64)


def main_lobe_rad() -> float:
    """Width of the ideal beam with the same main lobe: the pattern's integral over its peak."""
    offsets = np.radians(np.arange(-3.0, 3.0, 0.05))
    return float(horizontal(offsets).sum() * np.radians(0.05))


def spread(near_m: Floats, far_m: Floats, power: Floats, bin_m: float, bins: int) -> Floats:
    """Sum echoes into bins ``(bins,)``: each has its power spread evenly from ``near_m`` to ``far_m`` (all ``(n,)``).

    A bin holds what a pulse length at its range collects, so that the level of a distributed echo does not depend on
    how finely the head samples.
    """
    one = spread_rows(near_m, far_m, power, bin_m, bins, np.zeros(len(near_m), dtype=np.intp), 1)
    return one.reshape(bins)


def spread_rows(
    near_m: Floats, far_m: Floats, power: Floats, bin_m: float, bins: int, row: NDArray[np.intp], rows: int
) -> Floats:
    """Sum echoes into ``(rows, bins)``; ``row`` ``(n,)`` tells each echo's row (see ``spread``)."""
    density = power / np.maximum(far_m - near_m, 1e-9) * max(PULSE_M, bin_m)
    impulses = np.zeros(rows * (bins + 2))
    for edge_m, change in ((near_m, density), (far_m, -density)):
        place = np.clip(edge_m / bin_m, 0.0, bins + 0.5)
        low = place.astype(np.intp)
        share = place - low
        base = row * (bins + 2) + low
        size = len(impulses)
        impulses += np.bincount(base, change * (1.0 - share), size)
        impulses += np.bincount(base + 1, change * share, size + 1)[:size]
    # Edges are steps of density; their running sum is the density between grid points.
    summed: Floats = np.cumsum(impulses.reshape(rows, bins + 2), axis=1)[:, :bins]
    return np.asarray(np.maximum(summed, 0.0), dtype=np.float64)
