"""The verdict on a match: placed, doubtful or unplaced, and why, in a sentence for the pilot."""

from __future__ import annotations

import math

import numpy as np

from config.schema import Map
from mapping.led import LED_FIT, LED_MARGIN, LED_OVERLAP, WAY_FIT, WAY_OVERLAP, WAY_SD_M, walked
from mapping.prior import Cloud, Prior
from mapping.register import Match
from mapping.signs import MOST_BEHIND
from mapping.values import Pose, Scan, Station, Status

ACCEPT = 3.7
"""Log-odds from which a scan counts as placed: of 3,900 of buildings that the trees had not seen, none was wrong from
4.0 on, and one in three hundred from 3.5 ..."""
WIDE = 4.3
"""... where it is of a piece of which the map knows nothing ..."""
SEEN = 3.0
"""... where the way was seen, but not surely: what told it little tells little of the place too; along emulated smooth
tunnels, where a scan fits best where the vehicle did not move, none has more than 0.8 ..."""
GAP = 5.6
"""... where neither the scan before nor the one after is placed: pillars repeat, and reach is no bound then ..."""
LOST = 6.6
"""... and where that is so in a piece of which the map knows nothing."""
STILL, STILL_M = 4.4, 0.6
"""... and where a scan fits best so near to where the one before was made: what travels with the vehicle, ghosts and
the ends of what it sees, fits there in any tunnel."""
LEAST_MARGIN = 2.0
"""However much speaks for a place, what is so nearly as high elsewhere is not placed."""
DOUBT_MARGIN = 3.0
BAD_OVERLAP, BAD_FIT = 0.35, 0.4
"""Below these the pilot is told that a scan fits badly."""
ACCEPT_SD_M = 0.3
ASTRAY = 3.0
"""Standard deviations from the way that was seen, from which a scan that fits is not believed."""
ORIGIN_SD_M = 0.01


def judge(scan: Scan, match: Match, piece: int, prior: Prior, *, chained: bool) -> Station:
    """Make a station of a match: ``placed`` in the piece, or else the first of a piece of its own.

    ``chained`` tells that the scan before or the one after is of the piece.
    """
    sd_m = _sd_m(match)
    fits = match.margin >= LEAST_MARGIN and match.odds >= _needed(match, prior, piece, chained=chained)
    possible = match.behind <= MOST_BEHIND
    sure = possible and (is_led(match) if prior.is_led else fits)
    status: Status = "placed"
    if not sure or sd_m > ACCEPT_SD_M or match.astray > ASTRAY:
        if possible and prior.cloud is not None and is_seen(match, prior.cloud):
            put = walked(match, prior.cloud, 1.0 / (1.0 + math.exp(-match.odds)))
            return Station(scan, put.pose, put.covariance, "placed", piece, match.margin, _why_walked(put))
        status, piece = "doubtful" if match.margin >= DOUBT_MARGIN else "unplaced", scan.index + 1
    return Station(scan, match.pose, match.covariance, status, piece, match.margin, _why(status, match, sd_m))


def is_led(match: Match) -> bool:
    """Tell whether walls do not speak against a place that is known without them."""
    return match.margin >= LED_MARGIN and match.overlap >= LED_OVERLAP and match.fit >= LED_FIT


def is_seen(match: Match, cloud: Cloud) -> bool:
    """Tell whether the way led to a place, be it less surely along it than walls would tell."""
    sure = max(cloud.sd_m, _sd_m(match)) <= WAY_SD_M
    return sure and match.astray <= ASTRAY and match.overlap >= WAY_OVERLAP and match.fit >= WAY_FIT


def _sd_m(match: Match) -> float:
    return math.sqrt(float(np.linalg.eigvalsh(match.covariance[:2, :2])[-1]))


def origin(scan: Scan, config: Map) -> Station:
    """Begin the map with a scan."""
    heading_sd = math.radians(config.compass_sd_deg) / 4.0
    covariance = np.diag([ORIGIN_SD_M**2, ORIGIN_SD_M**2, heading_sd**2])
    return Station(scan, Pose(0.0, 0.0, scan.heading_rad), covariance, "placed", 0, math.nan, "the map begins here")


def nowhere(scan: Scan, config: Map, why: str) -> Station:
    """Make a station of a scan of which nothing is known."""
    covariance = np.diag([config.reach_m**2, config.reach_m**2, math.pi**2])
    return Station(scan, Pose(0.0, 0.0, scan.heading_rad), covariance, "unplaced", scan.index + 1, 0.0, why)


def _needed(match: Match, prior: Prior, piece: int, *, chained: bool) -> float:
    """Log-odds that a match needs: by what is known of it otherwise."""
    if prior.cloud is not None:
        return SEEN
    if not chained:
        return LOST if piece > 0 else GAP
    moved_m = math.hypot(match.pose.x_m - prior.x_m, match.pose.y_m - prior.y_m)
    if moved_m < STILL_M and not prior.gaussian:
        return STILL
    return WIDE if piece > 0 else ACCEPT


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
    if match.behind > MOST_BEHIND:
        return f"fits only where it would see known walls from behind, {fits}: take a scan nearer to the last one"
    if match.overlap < BAD_OVERLAP or match.fit < BAD_FIT:
        return f"fits badly, {fits}: take a scan nearer to the last one"
    return f"fits nearly as well elsewhere: {fits}; take a scan nearer to the last one, or give a hint"


def _why_walked(put: Match) -> str:
    """One sentence on a scan that the way led to."""
    long = np.linalg.eigh(put.covariance[:2, :2])[1][:, 1]
    axis = round(math.degrees(math.atan2(float(long[0]), float(long[1])))) % 180
    return f"the way there was seen, sd {_sd_m(put):.2f} m along {axis} degrees / {axis + 180} degrees"
