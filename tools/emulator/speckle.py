"""Speckle that stays: a field over direction, range and place that changes only when the vehicle moves.

Real heads at rest return the same speckle turn after turn (0.98 correlated); it is interference at the walls, not
noise of the receiver.  Correlations below were measured on the recordings of two Micron heads in tanks.
"""

from __future__ import annotations

from math import floor, tau
from typing import Final

import numpy as np
from numpy.typing import NDArray

DIRECTIONS: Final = 400
STEPS: Final = 4096
STEP_M: Final = 0.00625
PLACE_M: Final = 0.06

# (lag, correlation): convex and falling, so that each is the correlation of some random process (Polya's criterion).
_OVER_DEGREES: Final = ((0.0, 1.8, 3.6, 5.4, 30.0), (1.0, 0.6, 0.4, 0.3, 0.0))
_OVER_METRES: Final = ((0.0, 0.0125, 0.025, 0.038, 0.055), (1.0, 0.6, 0.3, 0.1, 0.0))


class Speckle:
    """A standard normal field of direction, range and place, fixed by its seed."""

    def __init__(self, seed: int) -> None:
        rng = np.random.default_rng((seed, 0x5BECC1E))
        white = np.fft.fft2(rng.standard_normal((DIRECTIONS, STEPS)))
        over_direction = _shape(DIRECTIONS, 360.0 / DIRECTIONS, _OVER_DEGREES)
        over_range = _shape(STEPS, STEP_M, _OVER_METRES)
        field = np.fft.ifft2(white * over_direction[:, None] * over_range[None, :]).real
        self._field: NDArray[np.float32] = (field / field.std()).astype(np.float32)
        self._seed = seed

    def along(
        self, x_m: float, y_m: float, angle_rad: float, range_m: NDArray[np.float64], layer: int = 0
    ) -> NDArray[np.float64]:
        """Return the field ``(n,)`` at ranges along a compass angle, seen from a place.

        It varies smoothly over about ``PLACE_M`` of movement.  Layers are independent of one another.
        """
        steps = np.round(range_m / STEP_M).astype(np.intp)
        column, fx = floor(x_m / PLACE_M), x_m / PLACE_M % 1.0
        row, fy = floor(y_m / PLACE_M), y_m / PLACE_M % 1.0
        total = np.zeros(len(range_m))
        power = 0.0
        for dc, dr in ((0, 0), (0, 1), (1, 0), (1, 1)):
            weight = (fx if dc else 1.0 - fx) * (fy if dr else 1.0 - fy)
            node = _scramble(column + dc, row + dr, self._seed + 977 * layer)
            total += weight * self._at_node(node, angle_rad, steps)
            power += weight * weight
        result: NDArray[np.float64] = total / np.sqrt(power)
        return result

    def _at_node(self, node: int, angle_rad: float, steps: NDArray[np.intp]) -> NDArray[np.float64]:
        """Read the one table from an offset of the node's own: nodes share it but not their parts of it."""
        place = angle_rad / tau * DIRECTIONS + node % DIRECTIONS
        low, share = floor(place), place % 1.0
        columns = (steps + node // DIRECTIONS) % STEPS
        first = self._field[low % DIRECTIONS, columns]
        second = self._field[(low + 1) % DIRECTIONS, columns]
        result: NDArray[np.float64] = (1.0 - share) * first.astype(np.float64) + share * second
        return result


def _shape(count: int, spacing: float, correlation: tuple[tuple[float, ...], tuple[float, ...]]) -> NDArray[np.float64]:
    """Return the amplitude ``(count,)`` of the periodic filter that gives white noise this correlation."""
    lag = np.minimum(np.arange(count), count - np.arange(count)) * spacing
    spectrum = np.fft.fft(np.interp(lag, correlation[0], correlation[1])).real
    return np.sqrt(np.maximum(spectrum, 0.0))


def _scramble(column: int, row: int, seed: int) -> int:
    """Mix integers to 31 bits without pattern (finaliser of splitmix64)."""
    value = (column * 0x9E3779B97F4A7C15 + row * 0xC2B2AE3D27D4EB4F + seed * 0x165667B19E3779F9) & (2**64 - 1)
    value = ((value ^ (value >> 30)) * 0xBF58476D1CE4E5B9) & (2**64 - 1)
    value = ((value ^ (value >> 27)) * 0x94D049BB133111EB) & (2**64 - 1)
    return (value ^ (value >> 31)) & 0x7FFFFFFF
