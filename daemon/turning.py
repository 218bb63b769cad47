"""How fast the sonar turns and what holds it up, for health."""

from __future__ import annotations

from drivers.records import Json
from drivers.tritech import units
from drivers.tritech.head import Head


def turning(head: Head) -> dict[str, Json]:
    """Return ``s_per_revolution`` as measured and ``limited_by``, what rules it; both null while the head rests.

    In a sector it is the time that a whole turn would take with such steps.
    """
    ping_s = head.ping_s
    if ping_s is None:
        return {"s_per_revolution": None, "limited_by": None}
    pings = units.TURN / units.step_units(head.sonar.step_deg)
    return {"s_per_revolution": round(ping_s * pings, 2), "limited_by": head.limits.ruling(ping_s)}
