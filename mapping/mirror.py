"""Mirror images: a smooth wall shows the room once more behind itself, by way of a bounce.

Such an image is of a wall that the scan has seen where it is, and the beam in which it appears passes the mirror on
its way: there it hears the mirror too, be it faintly.  A chamber behind a doorway has neither.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]

BEHIND_M: Final = 0.3
"""A return farther than this behind a wall's line is not of that wall."""
IMAGE_M: Final = 0.15
"""An image lies within this of what it is an image of."""
ECHO_M: Final = 0.1
HEARD: Final = 25.0
"""Counts above the floor of the mirror's own echo, within ``ECHO_M`` of its line."""
BESIDE_RAD: Final = math.radians(90.0)
"""The mirror was seen within this of the beam ..."""
VOTES: Final = 6
"""... by so many beams."""


@dataclass(frozen=True, slots=True)
class Heard:
    """Echoes ``excess`` ``(n, bins)`` above the floor; nearer than ``deaf_m`` ringing hides all but the loudest."""

    excess: Floats
    bin_m: float
    deaf_m: float


def images(bearing_rad: Floats, range_m: Floats, wall: Floats, sure: Flags, heard: Heard) -> Flags:
    """Tell which sure beams show a mirror image, ``(n,)``.

    ``wall`` ``(n, 2)`` are the walls of the sure beams as in ``mapping.lines``.
    """
    told = np.zeros(len(sure), dtype=bool)
    seen = np.flatnonzero(sure)
    if len(seen) < VOTES:
        return told
    inverse_m = np.hypot(wall[seen, 0], wall[seen, 1])
    normal = wall[seen] / inverse_m[:, None]
    ray = np.stack([np.sin(bearing_rad[seen]), np.cos(bearing_rad[seen])], axis=1)
    points = ray * range_m[seen, None]
    behind_m = points @ normal.T - 1.0 / inverse_m
    towards = ray @ wall[seen].T
    apart = np.abs((bearing_rad[seen, None] - bearing_rad[None, seen] + math.pi) % (2.0 * math.pi) - math.pi)
    beam, mirror = np.nonzero((behind_m > BEHIND_M) & (towards > 0.0) & (apart < BESIDE_RAD))
    passes = _passes(heard, seen[beam], 1.0 / towards[beam, mirror])
    beam, mirror = beam[passes], mirror[passes]
    image = points[beam] - 2.0 * behind_m[beam, mirror][:, None] * normal[mirror]
    distance, of = cKDTree(points).query(image, distance_upper_bound=IMAGE_M) if len(beam) else (np.zeros(0), beam)
    real = np.flatnonzero(np.isfinite(distance))
    real = real[behind_m[np.asarray(of)[real], mirror[real]] < ECHO_M]
    votes = np.bincount(beam[real], minlength=len(seen))
    told[seen] = votes >= VOTES
    return told


def _passes(heard: Heard, beams: NDArray[np.intp], mirror_m: Floats) -> Flags:
    """Whether beams hear a mirror at its place, or could not hear it there."""
    reach = max(1, round(ECHO_M / heard.bin_m))
    at = np.minimum(mirror_m / heard.bin_m, 2.0**30).astype(np.intp)[:, None] + np.arange(-reach, reach + 1)
    found = heard.excess[beams[:, None], np.clip(at, 0, heard.excess.shape[1] - 1)]
    echo = np.where(at < heard.excess.shape[1], found, -np.inf).max(axis=1, initial=-np.inf) > HEARD
    return np.asarray(echo | (mirror_m < heard.deaf_m))
