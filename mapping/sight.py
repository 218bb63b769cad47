"""A scan made ready: what it says of the water around it, and how registration sees it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

from config.schema import Map
from mapping.beam import PolarEvidence, polar_evidence
from mapping.field import field_of_scan
from mapping.values import Returns, Scan
from mapping.view import View, points_of, wall_points

CELL_M: Final = 0.05
"""Scans are held against each other in cells of this size, whatever the map's: what a point says was learnt in them."""


@dataclass(frozen=True, slots=True)
class Sight:
    """A scan, its returns, its evidence for the grid, and its view for registration.

    ``ground`` is the evidence in cells of ``CELL_M``, for references that other scans are held against.
    """

    scan: Scan
    returns: Returns
    evidence: PolarEvidence
    ground: PolarEvidence
    view: View


def sight_of(scan: Scan, returns: Returns, config: Map) -> Sight:
    """Make a scan ready for registration and for the grid."""
    ground = polar_evidence(scan, returns, math.radians(config.beam_deg), CELL_M)
    evidence = ground
    if config.cell_m != CELL_M:
        evidence = polar_evidence(scan, returns, math.radians(config.beam_deg), config.cell_m)
    points = points_of(*wall_points(scan.bearing_rad, returns))
    field = field_of_scan(scan.bearing_rad, returns, scan.step_rad, CELL_M)
    return Sight(scan, returns, evidence, ground, View(points, field))


def grounded(config: Map) -> Map:
    """Give the configuration of maps that scans are held against."""
    return config.model_copy(update={"cell_m": CELL_M})


def rise_m(a: Scan, b: Scan) -> float:
    """Difference of two scans' depths; 0 where one was not told."""
    rise = abs(a.depth_m - b.depth_m)
    return 0.0 if math.isnan(rise) else rise
