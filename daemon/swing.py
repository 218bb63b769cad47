"""What is told of the compass: its bias and deviation as the walls show them, and where it was disturbed."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

from daemon.snapshots import degrees
from drivers.records import Json
from mapping.compass import wrap
from mapping.swing import swing_of
from mapping.values import Station

CURVE_DEG: Final = range(0, 360, 30)


def compass_facts(stations: Sequence[Station]) -> dict[str, Json] | None:
    """Return bias and largest deviation with standard deviations, the curve, and disturbed stations; None without any.

    ``bias_deg`` is how far the compass reads clockwise of the map's north on average over all headings.  The map's
    north is what the compass said at the first station: an error that is the same everywhere turns the map unseen.
    ``curve`` are pairs of a heading as read and what to add to it for the compass's own mean north, as in a feed's
    ``deviation_deg``.
    """
    swing, told = swing_of(stations)
    if not told:
        return None
    deviation, deviation_sd = swing.deviation_rad
    add = {deg: swing.at(math.radians(deg))[0] + swing.bias_rad for deg in CURVE_DEG}
    return {
        "stations": len(told),
        "bias_deg": degrees(swing.bias_rad),
        "bias_sd_deg": degrees(swing.bias_sd_rad),
        "deviation_deg": degrees(deviation),
        "deviation_sd_deg": degrees(deviation_sd),
        "curve": [[deg, degrees(wrap(value))] for deg, value in add.items()],
        "disturbed": [s.scan.index for s, off in zip(told, swing.is_disturbed, strict=True) if off],
    }
