"""Fields of sentences: numbers, headings, lengths and pressures, each checked for what it can be."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

from config.errors import FrameError
from drivers.readings import Quality
from drivers.statements import AnyStatement, Meaning, Statement

_NUMBER: Final = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)")
_DEEPEST_M: Final = 12_000.0
_HIGHEST_M: Final = -10.0
UNIT_DEG: Final = {"deg": 1.0, "bam16": 360.0 / 65536.0, "mil": 360.0 / 6400.0}
"""Units of angles that compasses are set to."""


@dataclass(frozen=True, slots=True)
class Dialect:
    """What a sentence alone does not tell; `drivers.nmea` fills it from the configuration.

    ``angle_unit``: ``auto`` looks at the decimal point where a maker offers several.  Names are in capitals.
    ``talker``: the two letters that standard sentences must begin with; empty: any.
    """

    angle_unit: str = "auto"
    depth_names: frozenset[str] = frozenset({"DEPTH", "DPTH"})
    pressure_names: frozenset[str] = frozenset()
    talker: str = ""


Fields = Sequence[str]
Statements = Iterator[AnyStatement]


def number(fields: Fields, at: int) -> float | None:
    """Return the number in a field, None where it is null or absent; raise FrameError for anything else."""
    word = fields[at].strip() if at < len(fields) else ""
    if not word:
        return None
    if not _NUMBER.fullmatch(word):
        raise FrameError(f"field {at + 1} is {word!r}, not a number")
    return float(word)


def text(fields: Fields, at: int) -> str:
    """Return a field in capitals, empty where it is absent."""
    return fields[at].strip().upper() if at < len(fields) else ""


def state_heading(what: Meaning, value: float | None, quality: Quality = "good", reason: str = "") -> Statements:
    """State a heading in degrees, where there is one."""
    if value is None:
        return
    if not -360.0 < value <= 360.0:
        raise FrameError(f"a heading of {value} is not in degrees")
    yield Statement(what, value, quality, reason)


def state_length(what: Meaning, value: float | None) -> Statements:
    """State a depth or an altitude in metres, where there is one."""
    if value is None:
        return
    if not _HIGHEST_M <= value <= _DEEPEST_M:
        raise FrameError(f"a depth of {value} m is not possible")
    yield Statement(what, value)


def state_pressure(what: Meaning, value: float | None, unit_mbar: float) -> Statements:
    """State a pressure, where there is one; ``unit_mbar`` is its unit."""
    if value is not None:
        yield Statement(what, value * unit_mbar)
