"""What truly was: stations, trajectory and walls of an emulated dive, as JSON."""

from __future__ import annotations

from math import degrees

from drivers.records import Json
from tools.emulator.dive import Dive
from tools.emulator.echoes import Place
from tools.emulator.faults.calendar import NEVER_NS, Spell
from tools.emulator.vehicle import Rest


def truth_of(dive: Dive) -> dict[str, Json]:
    """Return the truth of a dive so far.

    Axes: x east, y north, z down from the surface, headings clockwise from true north; times in ns of the dive's own
    clock.  A station is where the vehicle was on average at rest.  ``trajectory`` rows are ``t_ns, x_m, y_m, depth_m,
    heading_deg``.
    """
    feed = dive.options.feed
    walls: list[Json] = [
        {"closed": wall.closed, "points": [[round(float(x), 4), round(float(y), 4)] for x, y in wall.points_m]}
        for wall in dive.site.walls
    ]
    return {
        "site": dive.site.name,
        "seed": dive.seed,
        "floor_m": dive.site.floor_m,
        "ceiling_m": dive.site.ceiling_m,
        "taper_per_m": dive.site.taper_per_m,
        "plan_depth_m": dive.site.plan_depth_m,
        "sound_speed_m_s": dive.options.sound_speed_m_s,
        "compass": {"bias_deg": feed.bias_deg, "deviation_deg": feed.deviation_deg, "sd_deg": feed.heading_sd_deg},
        "faults": [_fault(spell) for spell in dive.spells],
        "done": dive.done,
        "stations": [_station(dive, rest) for rest in dive.vehicle.rests],
        "trajectory": [[each.t_ns, *_row(each.place)] for each in dive.track],
        "walls": walls,
    }


def _station(dive: Dive, rest: Rest) -> dict[str, Json]:
    place = dive.place_during(rest)
    return {
        "index": rest.index,
        "x_m": round(place.x_m, 4),
        "y_m": round(place.y_m, 4),
        "depth_m": round(place.depth_m, 4),
        "heading_deg": round(degrees(place.heading_rad), 3),
        "rest_from_ns": rest.from_ns,
        "rest_to_ns": rest.to_ns,
    }


def told(spell: Spell) -> dict[str, Json]:
    """Return a fault that has come as its script tells it, with the port that it befell."""
    fault = spell.fault
    words: dict[str, Json] = fault.model_dump(exclude_none=True, exclude_unset=True)
    return {"kind": fault.kind, "port": fault.befalls, **words}


def _fault(spell: Spell) -> dict[str, Json]:
    ends: dict[str, Json] = {} if spell.to_ns >= NEVER_NS else {"to_ns": spell.to_ns}
    return {**told(spell), "from_ns": spell.from_ns, **ends}


def _row(place: Place) -> list[Json]:
    return [round(place.x_m, 4), round(place.y_m, 4), round(place.depth_m, 4), round(degrees(place.heading_rad), 3)]
