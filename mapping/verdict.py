"""The verdict on a match: placed, doubtful or unplaced, and why, in a sentence for the pilot."""

from __future__ import annotations

import math

import numpy as np

from config.schema import Map
from mapping.led import LED_FIT, LED_MARGIN, LED_OVERLAP
from mapping.prior import Prior
from mapping.register import Match
from mapping.values import Pose, Scan, Station, Status

ACCEPT_MARGIN = 8.0
"""Log-posterior over the best pose elsewhere from which a scan counts as placed."""
DOUBT_MARGIN = 3.0
ACCEPT_OVERLAP = 0.35
"""Share of a scan's walls that must lie on known ones."""
ACCEPT_FIT = 0.68
"""Score per independent point: a scan whose true place is out of reach fits somewhere, but badly."""
WIDE_MARGIN = 9.0
"""The same where the way was followed, and lost: walls that tell it nothing tell less of the place too."""
GAP_MARGIN, GAP_FIT = 16.0, 1.2
"""The same where neither the scan before nor the one after is placed: pillars repeat, and reach is no bound then."""
LOST_MARGIN, LOST_FIT = 30.0, 1.3
"""The same where the way over the gap was followed, and lost: it led farther than anything that the map knows."""
ACCEPT_SD_M = 0.3
SEEN_SD_M, SEEN_FIT = 0.7, 0.45
"""Where the way was seen so well, a scan that fits there may fit less well."""
ASTRAY = 3.0
"""Standard deviations from the way that was seen, from which a scan that fits is not believed."""
ORIGIN_SD_M = 0.01


def judge(scan: Scan, match: Match, piece: int, prior: Prior, *, chained: bool) -> Station:
    """Make a station of a match: ``placed`` in the piece, or else the first of a piece of its own.

    ``chained`` tells that the scan before or the one after is of the piece.
    """
    sd_m = math.sqrt(float(np.linalg.eigvalsh(match.covariance[:2, :2])[-1]))
    seen = prior.cloud is not None and prior.cloud.sd_m <= SEEN_SD_M
    lost = piece > 0 or (prior.cloud is not None and not seen)
    margin, fit = (LED_MARGIN, LED_FIT) if prior.is_led else _needed(seen, lost, chained)
    fits = match.overlap >= (LED_OVERLAP if prior.is_led else ACCEPT_OVERLAP) and match.fit >= fit
    status: Status = "placed"
    if match.margin < margin or not fits or sd_m > ACCEPT_SD_M or match.astray > ASTRAY:
        status, piece = "doubtful" if match.margin >= DOUBT_MARGIN else "unplaced", scan.index + 1
    return Station(scan, match.pose, match.covariance, status, piece, match.margin, _why(status, match, sd_m))


def origin(scan: Scan, config: Map) -> Station:
    """Begin the map with a scan."""
    heading_sd = math.radians(config.compass_sd_deg) / 4.0
    covariance = np.diag([ORIGIN_SD_M**2, ORIGIN_SD_M**2, heading_sd**2])
    return Station(scan, Pose(0.0, 0.0, scan.heading_rad), covariance, "placed", 0, math.nan, "the map begins here")


def nowhere(scan: Scan, config: Map, why: str) -> Station:
    """Make a station of a scan of which nothing is known."""
    covariance = np.diag([config.reach_m**2, config.reach_m**2, math.pi**2])
    return Station(scan, Pose(0.0, 0.0, scan.heading_rad), covariance, "unplaced", scan.index + 1, 0.0, why)


def _needed(seen: bool, lost: bool, chained: bool) -> tuple[float, float]:
    """Margin and fit that a match needs: by whether the way was seen, or followed and lost."""
    if seen:
        return ACCEPT_MARGIN, SEEN_FIT
    if chained:
        return (WIDE_MARGIN if lost else ACCEPT_MARGIN), ACCEPT_FIT
    return (LOST_MARGIN, LOST_FIT) if lost else (GAP_MARGIN, GAP_FIT)


def _why(status: Status, match: Match, sd_m: float) -> str:
    """One sentence for the pilot."""
    fits = f"{match.overlap:.0%} of its walls lie on known ones"
    if status == "placed":
        return f"{fits}, sd {sd_m:.2f} m"
    weak = round(math.degrees(match.weak_rad)) % 180
    if sd_m > ACCEPT_SD_M or match.hold < 0.05:
        return f"could slide along {weak} degrees / {weak + 180} degrees: {fits}; take a scan nearer to the last one"
    if match.astray > ASTRAY:
        return f"the way there led elsewhere, {fits}: take a scan nearer to the last one, or give a hint"
    if match.overlap < ACCEPT_OVERLAP or match.fit < ACCEPT_FIT:
        return f"fits badly, {fits}: take a scan nearer to the last one"
    return f"fits nearly as well elsewhere: {fits}; take a scan nearer to the last one, or give a hint"
