"""What the columns of a text line are, where the line itself says it: a number followed by its unit.

``0009.996,M,0.000`` tells metres in its first column.  Numbers without a unit tell nothing: then the operator must.
"""

from __future__ import annotations

import re
from collections import Counter
from itertools import pairwise
from typing import Final

from drivers.pressure import BETWEEN, MBAR, METRES, NUMBER
from drivers.records import Json

_LINES: Final = re.compile(r"[\r\n]+")
_SHARE: Final = 0.9
"""So many of the whole lines must look alike."""
_LEAST_LINES: Final = 3
_VACUUM_MBAR: Final = 500.0
"""Less than this is no absolute pressure on Earth's surface or below."""


def guess_columns(data: bytes) -> dict[str, Json] | None:
    """Return ``column``, ``unit`` and, of pressures, ``pressure`` of lines of text; None where they do not say it.

    The first and the last line may be cut short and are not looked at.
    """
    lines = _LINES.split(data.decode("ascii", "replace"))[1:-1]
    if len(lines) < _LEAST_LINES:
        return None
    found = Counter(place for line in lines for place in [_place(line)] if place is not None)
    if not found:
        return None
    (column, unit), count = found.most_common(1)[0]
    if count < _SHARE * len(lines):
        return None
    settings: dict[str, Json] = {"column": column, "unit": unit}
    if unit in MBAR:
        least = min(float(_words(line)[column - 1]) for line in lines if _place(line) == (column, unit))
        settings["pressure"] = "gauge" if least * MBAR[unit] < _VACUUM_MBAR else "absolute"
    return settings


def _place(line: str) -> tuple[int, str] | None:
    """Column and unit of the first number of a line that is followed by a unit."""
    words = _words(line)
    for at, (word, after) in enumerate(pairwise(words), 1):
        if NUMBER.fullmatch(word) and (after.lower() in MBAR or after.lower() in METRES):
            return at, after.lower()
    return None


def _words(line: str) -> list[str]:
    return BETWEEN.split(line.strip())
