"""Where odometry, or the way as it was seen, led: what that tells of a place that walls alone do not."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from mapping.prior import Cloud, Floats, Hint, Prior
from mapping.register import Match
from mapping.values import Displacement, Pose

LED_SD_M = 0.1
"""Least uncertainty of odometry from one scan to the next."""
LED_MARGIN, LED_OVERLAP, LED_FIT = 3.0, 0.2, 0.1
"""Walls must only not speak against a place that is known without them."""
SLIDES = 0.12
"""Information along the weakest axis (0.5 is the most) below which walls are not asked where along it a scan was made:
wherever smooth walls lie on smooth walls, what differs least is the scan that did not move."""
WAY_SD_M = 0.5
"""Where the way tells no more surely than this where a scan was made, it is no place, for walls are drawn by it ..."""
WAY_FIT, WAY_OVERLAP = 0.1, 0.2
"""... nor where what was seen there does not fit."""


def led(moved: Sequence[Displacement | None], turn_rad: float, *, back: bool, reach_m: float) -> Hint | None:
    """Join what odometry tells of the ways from a station to a scan, in map axes; None where it does not tell all.

    ``turn_rad`` is how far the map is turned from the compass at the station; ``back`` tells that the scan was first.
    """
    told = [each for each in moved if each is not None]
    sd_m = sum(each.sd_m for each in told)
    if len(told) < len(moved) or not told or sd_m > reach_m / 2.0:
        return None
    sign = -1.0 if back else 1.0
    x_m, y_m = sign * sum(each.dx_m for each in told), sign * sum(each.dy_m for each in told)
    return Hint(x_m, y_m, sd_m, LED_SD_M).turned(turn_rad)


def along(match: Match, prior: Prior) -> Match:
    """Put a scan that walls leave free to slide where odometry or the way led, along the line on which it slides."""
    place = prior.led_to
    if place is None or match.hold >= SLIDES:
        return match
    axis = np.array([math.sin(match.weak_rad), math.cos(match.weak_rad)])
    short_m = float((np.array([place.x_m, place.y_m]) - [match.pose.x_m, match.pose.y_m]) @ axis)
    x_m, y_m = np.array([match.pose.x_m, match.pose.y_m]) + short_m * axis
    covariance = _across(match.covariance, axis)
    covariance[:2, :2] += float(axis @ place.covariance @ axis) * np.outer(axis, axis)
    return replace(match, pose=Pose(float(x_m), float(y_m), match.pose.heading_rad), covariance=covariance)


def walked(match: Match, cloud: Cloud, trust: float) -> Match:
    """Put a scan, along the way to it, between where its walls say and where the way alone led.

    ``trust`` is the probability that the walls are right; what both say is told as one normal, across the way as the
    walls say it.
    """
    axis = np.linalg.eigh(cloud.covariance)[1][:, 1]
    apart_m = float(np.array([cloud.x_m - match.pose.x_m, cloud.y_m - match.pose.y_m]) @ axis)
    own, told = (float(axis @ each @ axis) for each in (match.covariance[:2, :2], cloud.covariance))
    x_m, y_m = np.array([match.pose.x_m, match.pose.y_m]) + (1.0 - trust) * apart_m * axis
    variance = trust * own + (1.0 - trust) * told + trust * (1.0 - trust) * apart_m**2
    covariance = _across(match.covariance, axis)
    covariance[:2, :2] += variance * np.outer(axis, axis)
    return replace(match, pose=Pose(float(x_m), float(y_m), match.pose.heading_rad), covariance=covariance)


def _across(covariance: Floats, axis: Floats) -> Floats:
    """Leave of a covariance ``(3, 3)`` what is not along an axis."""
    across = np.eye(3)
    across[:2, :2] -= np.outer(axis, axis)
    return np.asarray(across @ covariance @ across, dtype=np.float64)
