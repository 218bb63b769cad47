"""A scan made ready: what it says of the water around it, and how registration sees it."""

from __future__ import annotations

import math
from dataclasses import dataclass

from config.schema import Map
from mapping.beam import PolarEvidence, polar_evidence
from mapping.field import field_of_scan
from mapping.values import Returns, Scan
from mapping.view import View, points_of, wall_points


@dataclass(frozen=True, slots=True)
class Sight:
    """A scan, its returns, its evidence for the grid, and its view for registration."""

    scan: Scan
    returns: Returns
    evidence: PolarEvidence
    view: View


def sight_of(scan: Scan, returns: Returns, config: Map) -> Sight:
    """Make a scan ready for registration and for the grid."""
    evidence = polar_evidence(scan, returns, math.radians(config.beam_deg), config.cell_m)
    points = points_of(*wall_points(scan.bearing_rad, returns))
    field = field_of_scan(scan.bearing_rad, returns, scan.step_rad, config.cell_m)
    return Sight(scan, returns, evidence, View(points, field))


def rise_m(a: Scan, b: Scan) -> float:
    """Difference of two scans' depths; 0 where one was not told."""
    rise = abs(a.depth_m - b.depth_m)
    return 0.0 if math.isnan(rise) else rise
