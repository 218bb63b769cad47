"""Pieces: stations that fit each other while nothing ties them to the map.

The poses of a floating piece are a guess as a whole; how its stations lie to each other is known.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mapping.compass import wrap
from mapping.values import Pose, Station

LEAST_VARIANCE = 1e-6


@dataclass(frozen=True, slots=True)
class Shift:
    """A turn clockwise about a point, and then a move: what brings a floating piece into the map."""

    about_x_m: float
    about_y_m: float
    to_x_m: float
    to_y_m: float
    turn_rad: float
    covariance: NDArray[np.float64]

    @staticmethod
    def between(there: Station, here: Station) -> Shift:
        """Find the shift that brings a scan's place in a piece to its place in the map."""
        a, b = there.pose, here.pose
        return Shift(a.x_m, a.y_m, b.x_m, b.y_m, wrap(b.heading_rad - a.heading_rad), here.covariance)

    def of(self, pose: Pose) -> Pose:
        """Move a pose."""
        c, s = math.cos(self.turn_rad), math.sin(self.turn_rad)
        dx, dy = pose.x_m - self.about_x_m, pose.y_m - self.about_y_m
        heading_rad = (pose.heading_rad + self.turn_rad) % (2.0 * math.pi)
        return Pose(self.to_x_m + c * dx + s * dy, self.to_y_m - s * dx + c * dy, heading_rad)

    def lever(self, pose: Pose) -> NDArray[np.float64]:
        """Covariance ``(3, 3)`` that a pose in the piece gets from the shift's own."""
        moved = self.of(pose)
        dx, dy = moved.x_m - self.to_x_m, moved.y_m - self.to_y_m
        by = np.array([[1.0, 0.0, dy], [0.0, 1.0, -dx], [0.0, 0.0, 1.0]])
        return np.asarray(by @ self.covariance @ by.T, dtype=np.float64)


def floating(tied: Station, piece: int, first: NDArray[np.float64], to_scan: int) -> Station:
    """Make a station of a floating piece; ``first`` is the covariance ``(3, 3)`` of the piece's first station."""
    why = f"fits scan {to_scan}, but nothing ties the two to the map yet; go back to where the map is sure"
    return replace(tied, status="unplaced", piece=piece, covariance=tied.covariance + first, why=why)


def landed(station: Station, shift: Shift, first: NDArray[np.float64]) -> Station:
    """Place a station of a piece that joins the map."""
    own = station.covariance - first  # what the piece itself does not know of it
    value, vector = np.linalg.eigh(0.5 * (own + own.T))
    own = vector @ np.diag(np.maximum(value, LEAST_VARIANCE)) @ vector.T
    covariance = own + shift.lever(station.pose)
    why = "placed with its piece, which another of its scans ties to the map"
    return replace(station, pose=shift.of(station.pose), covariance=covariance, status="placed", piece=0, why=why)
