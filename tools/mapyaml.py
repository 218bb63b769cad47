"""The few lines of YAML that describe a ROS map_server map.

A map's description is a flat table of scalars and one list; a parser for that much is smaller than a dependency.
Source: ROS wiki, map_server, "YAML format"; nav2_map_server adds ``mode`` and quoted names.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

from config.errors import DataError

MODES: Final = ("trinary", "scale", "raw")


@dataclass(frozen=True, slots=True)
class MapDescription:
    """What the .yaml says: image name, cell size, origin of the lower left pixel, and how grey becomes occupancy."""

    image: str
    cell_m: float
    x0_m: float
    y0_m: float
    yaw_rad: float
    negate: bool
    occupied_thresh: float
    free_thresh: float
    mode: str


def parse_description(text: str, name: str) -> MapDescription:
    """Read a description; ``name`` is the file's name for messages.  Raises DataError."""
    table = _table(text, name)
    origin = _numbers(table.get("origin", "[0, 0, 0]"), name)
    if len(origin) not in (2, 3):
        raise DataError(f"{name}: 'origin' has {len(origin)} numbers; give [x, y, yaw]")
    described = MapDescription(
        image=_text(_required(table, "image", name)),
        cell_m=_number(_required(table, "resolution", name), "resolution", name),
        x0_m=origin[0],
        y0_m=origin[1],
        yaw_rad=origin[2] if len(origin) == 3 else 0.0,
        negate=_text(table.get("negate", "0")).lower() in ("1", "true", "yes"),
        occupied_thresh=_number(table.get("occupied_thresh", "0.65"), "occupied_thresh", name),
        free_thresh=_number(table.get("free_thresh", "0.196"), "free_thresh", name),
        mode=_text(table.get("mode", "trinary")).lower(),
    )
    _check(described, name)
    return described


def describe(described: MapDescription) -> str:
    """Write a description as .yaml text; numbers keep every digit."""
    return (
        f"image: {described.image}\nmode: {described.mode}\nresolution: {described.cell_m!r}\n"
        f"origin: [{described.x0_m!r}, {described.y0_m!r}, {described.yaw_rad!r}]\nnegate: {int(described.negate)}\n"
        f"occupied_thresh: {described.occupied_thresh!r}\nfree_thresh: {described.free_thresh!r}\n"
    )


def _check(described: MapDescription, name: str) -> None:
    if not 1e-4 <= described.cell_m <= 100:
        raise DataError(f"{name}: 'resolution' is {described.cell_m}; give metres per pixel, above 0")
    if not 0 <= described.free_thresh < described.occupied_thresh <= 1:
        raise DataError(f"{name}: free_thresh must be below occupied_thresh, both in 0 to 1; mend the thresholds")
    if described.mode not in MODES:
        raise DataError(f"{name}: mode '{described.mode}' is not known; give one of {', '.join(MODES)}")


def _table(text: str, name: str) -> dict[str, str]:
    table: dict[str, str] = {}
    key = ""
    for number, line in enumerate(text.splitlines(), 1):
        bare = _without_comment(line)
        if not bare or bare in ("---", "..."):
            continue
        if bare.startswith("- ") and key:  # a list written one item a line
            table[key] = f"{table[key]},{bare[2:]}"
        elif ":" in bare:
            key, _, value = (part.strip() for part in bare.partition(":"))
            table[key] = value
        elif key and table[key].startswith("[") and "]" not in table[key]:
            table[key] += bare
        else:
            raise DataError(f"{name}: line {number} is not 'key: value'; is this a map_server .yaml?")
    return table


def _without_comment(line: str) -> str:
    start = 0 if line.lstrip().startswith("#") else line.find(" #")
    return (line if start < 0 else line[:start]).strip()


def _required(table: dict[str, str], key: str, name: str) -> str:
    if not table.get(key):
        raise DataError(f"{name}: '{key}' is missing; is this a map_server .yaml?")
    return table[key]


def _text(value: str) -> str:
    return value.strip().strip("'\"")


def _number(value: str, key: str, name: str) -> float:
    try:
        number = float(_text(value))
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        raise DataError(f"{name}: '{key}' is '{value}'; give a number")
    return number


def _numbers(value: str, name: str) -> list[float]:
    return [_number(part, "origin", name) for part in value.strip().strip("[]").split(",") if part.strip()]
