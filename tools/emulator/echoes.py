"""One ping's echoes from place, bearing and settings.

Level scale: 0.314 dB a count (255 counts are 80 dB).  Figures of level, speckle, ringing and ghosts follow measurements
on recordings of two Micron heads in tanks; spreading and absorption are taken to be what the head's gain over range
takes out.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from tools.emulator.fan import View
from tools.emulator.scene import Scene
from tools.emulator.site import Site
from tools.emulator.speckle import Speckle

Floats = NDArray[np.float64]

COUNTS_PER_DB: Final = 255.0 / 80.0
SPECKLE_DB: Final = 4.5
_WOBBLE_DB: Final = 0.35
_FLOOR_DB: Final = 6.5
_FLOOR_SD_DB: Final = 5.5
_FLOOR_FROM_M: Final = 1.56
_NOMINAL_GAIN_DB: Final = 40.0


@dataclass(frozen=True, slots=True)
class Place:
    """Where the vehicle is: plan, depth, and heading clockwise from north."""

    x_m: float
    y_m: float
    depth_m: float
    heading_rad: float


@dataclass(frozen=True, slots=True)
class Sampling:
    """How the head samples a ping: true length of a bin, number of bins, gain (40 dB is the middle)."""

    bin_m: float
    bins: int
    gain_db: float = _NOMINAL_GAIN_DB


class EchoModel:
    """Echoes of a site, deterministic in place, heading, ping number and seed."""

    def __init__(self, site: Site, seed: int) -> None:
        self._scene = Scene(site, seed)
        self._speckle = Speckle(seed)
        self._seed = seed

    def ping(self, place: Place, bearing_rad: float, sampling: Sampling, number: int) -> NDArray[np.uint8]:
        """Return the bins ``(bins,)`` of a beam at ``bearing_rad`` clockwise from the bow.

        ``number`` counts pings; only the receiver's faint own noise depends on it.
        """
        angle = (place.heading_rad + bearing_rad) % (2.0 * np.pi)
        ranges: Floats = (np.arange(sampling.bins, dtype=np.float64) + 0.5) * sampling.bin_m
        wall = self._scene.power(View(place.x_m, place.y_m, place.depth_m, sampling.bin_m, sampling.bins), angle)
        noise = [self._speckle.along(place.x_m, place.y_m, angle, ranges, layer) for layer in range(3)]
        level = _db(wall) + SPECKLE_DB * _skewed(noise[0])
        floor = np.where(ranges >= _FLOOR_FROM_M, _FLOOR_DB + _FLOOR_SD_DB * _skewed(noise[1]), -40.0)
        level = _db(10.0 ** (level / 10.0) + 10.0 ** (floor / 10.0) + 10.0 ** (_specks(ranges, noise[2]) / 10.0))
        level = np.maximum(level, _ringing(ranges) + 1.2 * noise[1])
        rng = np.random.default_rng((self._seed, number))
        level += _WOBBLE_DB * rng.standard_normal(sampling.bins) + (sampling.gain_db - _NOMINAL_GAIN_DB)
        return np.clip(np.round(level * COUNTS_PER_DB), 0, 255).astype(np.uint8)


def _db(power: Floats) -> Floats:
    return np.asarray(10.0 * np.log10(np.maximum(power, 1e-4)), dtype=np.float64)


def _skewed(normal: Floats) -> Floats:
    """Bend a standard normal towards deep fades, as interference gives them, keeping mean and deviation."""
    return np.asarray((normal - 0.18 * (normal * normal - 1.0)) / 1.032, dtype=np.float64)


def _ringing(ranges_m: Floats) -> Floats:
    """Level of the transducer's own ringing: the same at all bearings, gone after some 0.35 m."""
    level = np.interp(
        ranges_m,
        (0.0, 0.045, 0.05, 0.09, 0.12, 0.21, 0.26, 0.30, 0.35, 0.42),
        (-40.0, -40.0, 14.0, 30.0, 33.5, 33.0, 26.0, 14.0, 4.0, -40.0),
    )
    return np.asarray(level, dtype=np.float64)


def _specks(ranges_m: Floats, noise: Floats) -> Floats:
    """Level of small scatterers in the water near the head, fewer and fainter outwards."""
    middle_db = np.interp(ranges_m, (0.30, 0.35, 0.5, 0.75, 1.0, 1.3), (-40.0, 4.0, 1.0, -5.0, -17.0, -40.0))
    return np.asarray(np.minimum(middle_db + 13.0 * noise, 26.0), dtype=np.float64)
