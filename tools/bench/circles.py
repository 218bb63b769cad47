"""Recordings of a head that turns at rest, kept as arrays: what tanks are measured on.

An archive holds ``angle_deg`` ``(n,)`` and ``intensity`` ``(n, bins)``, a beam a row in the order in which they came,
and ``bin_m``, the length of a bin, as often as it was noted.  How many beams make a circle is read off the angles.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from config.errors import DataError, InputError
from mapping.values import Scan

_ARRAYS: Final = {"angle_deg", "bin_m", "intensity"}


@dataclass(frozen=True, slots=True)
class Circles:
    """Beams of a recording: bearings ``(n,)`` float64, echoes ``(n, bins)`` uint8, ``beams`` of them to a circle."""

    bearing_rad: NDArray[np.float64]
    echoes: NDArray[np.uint8]
    bin_m: float
    beams: int

    @property
    def count(self) -> int:
        """Whole circles."""
        return len(self.bearing_rad) // self.beams

    def first(self, count: int) -> Circles:
        """Return no more than the first circles."""
        kept = min(count, self.count) * self.beams
        return Circles(self.bearing_rad[:kept], self.echoes[:kept], self.bin_m, self.beams)

    @property
    def scans(self) -> list[Scan]:
        """A scan of each circle, its heading 0 and its depth unknown."""
        step_rad = math.tau / self.beams
        turns = [slice(k * self.beams, (k + 1) * self.beams) for k in range(self.count)]
        return [
            Scan(k, 0, 1, 0.0, math.nan, self.bearing_rad[s], self.echoes[s], self.bin_m, step_rad, "full")
            for k, s in enumerate(turns)
        ]


def recordings(data: Path) -> list[Path]:
    """Find the recordings of circles in a folder of recordings.  Raises InputError where there is none."""
    found = [path for path in sorted((data / "sonar").glob("*.npz")) if _names(path) >= _ARRAYS]
    if not found:
        raise InputError(f"no recording of circles in {data / 'sonar'}; name the folder of recordings with --data")
    return found


def read_circles(path: Path) -> Circles:
    """Read a recording.  Raises InputError or DataError where it is not there or is something else."""
    try:
        with np.load(path, allow_pickle=False) as arrays:
            bearing_rad = np.radians(arrays["angle_deg"].astype(np.float64))
            bin_m, echoes = float(np.median(arrays["bin_m"])), arrays["intensity"].astype(np.uint8)
    except OSError as error:
        raise InputError(f"cannot read {path}: {error.strerror}; give the folder of recordings") from error
    except (KeyError, ValueError) as error:
        raise DataError(f"{path} is not a recording of circles: {error}") from error
    step_rad = np.abs(np.angle(np.exp(1j * np.diff(bearing_rad)))) if len(bearing_rad) > 1 else np.zeros(1)
    if not np.median(step_rad) > 0.0:
        raise DataError(f"{path} is not a recording of circles: the head does not turn in it")
    circles = Circles(bearing_rad, echoes, bin_m, round(math.tau / float(np.median(step_rad))))
    if not circles.count:
        raise DataError(f"{path} holds {len(bearing_rad)} beams, which are no whole circle")
    return circles


def _names(path: Path) -> set[str]:
    try:
        with np.load(path, allow_pickle=False) as arrays:
            return set(arrays.files)
    except (OSError, ValueError):
        return set()
