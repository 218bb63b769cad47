"""What each sentence says about heading, depth and altitude (NMEA 0183 and makers' manuals).

A null field means that a quantity is not available: it gives nothing, never zero.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Final

from config.errors import FrameError

_NUMBER: Final = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)")
_LETTERS: Final = re.compile(r"C-?\d+(?:\.\d+)?(?:[A-Z][a-z]?-?\d+(?:\.\d+)?)*")
_TAGGED: Final = re.compile(r"([A-Z][a-z]?)(-?\d+(?:\.\d+)?)")
_FOOT_M: Final = 0.3048
_FATHOM_M: Final = 1.8288
_BAM_DEG: Final = 360.0 / 65536.0
_DEEPEST_M: Final = 12_000.0
_HIGHEST_M: Final = -10.0
_DEPTH_NAMES: Final = frozenset({"DEPTH", "DPTH"})


class Said(Enum):
    """What a number in a sentence means."""

    MAGNETIC = "magnetic heading, degrees"
    TRUE = "true heading, degrees"
    VARIATION = "magnetic variation, degrees, east positive"
    BELOW_SURFACE = "distance of a thing below the surface, metres: the vehicle's depth, if the feed is so configured"
    ABOVE_FLOOR = "distance down to a thing, metres: the vehicle's altitude, if the feed is so configured"
    DEPTH = "the vehicle's depth, metres"
    ALTITUDE = "the vehicle's altitude, metres"


@dataclass(frozen=True, slots=True)
class Statement:
    """One quantity of a sentence."""

    what: Said
    value: float


Fields = Sequence[str]
Statements = Iterator[Statement]


def read(address: str, fields: Fields) -> tuple[str, list[Statement]] | None:
    """Name of a sentence and what it says, or None for one that says nothing about heading or depth.

    ``address`` is the first field, without ``$``.  Raises FrameError for a field that is not what it must be.
    """
    if not fields and _LETTERS.fullmatch(address):
        return "C", list(_letters(address))
    name = address if address in PROPRIETARY else address[2:] if len(address) == 5 else ""
    reader = PROPRIETARY.get(name) or STANDARD.get(name)
    return None if reader is None else (name, list(reader(fields)))


def _number(fields: Fields, at: int) -> float | None:
    text = fields[at].strip() if at < len(fields) else ""
    if not text:
        return None
    if not _NUMBER.fullmatch(text):
        raise FrameError(f"field {at + 1} is {text!r}, not a number")
    return float(text)


def _text(fields: Fields, at: int) -> str:
    return fields[at].strip().upper() if at < len(fields) else ""


def _heading(what: Said, value: float | None) -> Statements:
    if value is None:
        return
    if not -360.0 < value <= 360.0:
        raise FrameError(f"a heading of {value} is not in degrees")
    yield Statement(what, value)


def _length(what: Said, value: float | None) -> Statements:
    if value is None:
        return
    if not _HIGHEST_M <= value <= _DEEPEST_M:
        raise FrameError(f"a depth of {value} m is not possible")
    yield Statement(what, value)


def _toward(value: float | None, letter: str) -> float:
    """Signed angle of a value with E or W; nothing is zero."""
    if not value:
        return 0.0
    if letter not in ("E", "W"):
        raise FrameError(f"{value} needs E or W, got {letter!r}")
    return value if letter == "E" else -value


def _hdg(fields: Fields) -> Statements:
    heading = _number(fields, 0)
    # Compasses that know no variation write 0.0 as often as nothing.
    variation = _toward(_number(fields, 3), _text(fields, 4))
    if variation:
        yield Statement(Said.VARIATION, variation)
    if heading is not None:
        corrected = heading + _toward(_number(fields, 1), _text(fields, 2))
        yield from _heading(Said.MAGNETIC, corrected % 360.0 if abs(heading) <= 360.0 else heading)


def _hdm(fields: Fields) -> Statements:
    yield from _heading(Said.MAGNETIC, _number(fields, 0))


def _hdt(fields: Fields) -> Statements:
    yield from _heading(Said.TRUE, _number(fields, 0))


def _ths(fields: Fields) -> Statements:
    # A autonomous, E estimated; not M (typed in by hand), S (simulator), V (invalid).
    if _text(fields, 1) in ("A", "E"):
        yield from _hdt(fields)


def _vhw(fields: Fields) -> Statements:
    true = _number(fields, 0)
    if true is not None:
        yield from _heading(Said.TRUE, true)
    else:
        yield from _heading(Said.MAGNETIC, _number(fields, 2))


def _metres(fields: Fields) -> float | None:
    for at, unit_m in ((2, 1.0), (0, _FOOT_M), (4, _FATHOM_M)):
        value = _number(fields, at)
        if value is not None:
            return value * unit_m
    return None


def _dbt(fields: Fields) -> Statements:
    yield from _length(Said.BELOW_SURFACE, _metres(fields))
    yield from _length(Said.ABOVE_FLOOR, _metres(fields))


def _dbs(fields: Fields) -> Statements:
    yield from _length(Said.BELOW_SURFACE, _metres(fields))


def _dpt(fields: Fields) -> Statements:
    below = _number(fields, 0)
    if below is None:
        return
    # A positive offset is from the transducer up to the waterline; a negative one is to the keel.
    offset = max(_number(fields, 1) or 0.0, 0.0)
    yield from _length(Said.BELOW_SURFACE, below + offset)
    yield from _length(Said.ABOVE_FLOOR, below)


def _xdr(fields: Fields) -> Statements:
    """Take only distances that are called depth: a pressure may be absolute or not, or the weather's."""
    for at in range(0, len(fields) - 3, 4):
        if _text(fields, at) == "D" and _text(fields, at + 2) == "M" and _text(fields, at + 3) in _DEPTH_NAMES:
            yield from _length(Said.DEPTH, _number(fields, at + 1))


def _pashr(fields: Fields) -> Statements:
    if _text(fields, 2) == "T":
        yield from _heading(Said.TRUE, _number(fields, 1))


def _psxn(fields: Fields) -> Statements:
    if _text(fields, 0) == "23":
        yield from _heading(Said.TRUE, _number(fields, 3))


def _prdid(fields: Fields) -> Statements:
    yield from _heading(Said.TRUE, _number(fields, 2))


def _tnt_is_bad(fields: Fields) -> bool:
    """Calibration alarm, low or high alarm, voltage alarm."""
    return _text(fields, 1) in ("C", "L", "P", "V")


def _ptnthtm(fields: Fields) -> Statements:
    heading = _number(fields, 0)
    if heading is None or _tnt_is_bad(fields):
        return
    # In 16-bit mode (65536 to the turn) no angle has a decimal point; in degrees each has one.
    binary = not any("." in field for field in fields[0:5:2])
    yield from _heading(Said.TRUE, heading % 65536.0 * _BAM_DEG if binary else heading)


def _ptnthpr(fields: Fields) -> Statements:
    heading = _number(fields, 0)
    if heading is None or _tnt_is_bad(fields):
        return
    if not any("." in field for field in fields[0:5:2]):
        raise FrameError("PTNTHPR without decimals is in mils or 16-bit angles; set the compass to degrees")
    yield from _heading(Said.MAGNETIC, heading)


def _pvrnd(fields: Fields) -> Statements:
    yield from _length(Said.DEPTH, _number(fields, 2))
    yield from _heading(Said.MAGNETIC, _number(fields, 3))


def _rov(fields: Fields) -> Statements:
    yield from _heading(Said.TRUE, _number(fields, 0))
    yield from _length(Said.DEPTH, _number(fields, 3))
    # A vehicle is never at 0.0 m above the floor: that is an altimeter without an echo.
    yield from _length(Said.ALTITUDE, _number(fields, 4) or None)


def _letters(body: str) -> Statements:
    """OceanServer and PNI: C heading, D depth, among other tags without commas."""
    tags = dict(_TAGGED.findall(body))
    yield from _heading(Said.MAGNETIC, float(tags["C"]))
    if "D" in tags:
        yield from _length(Said.DEPTH, float(tags["D"]))


STANDARD: Final[dict[str, Callable[[Fields], Statements]]] = {
    "HDG": _hdg,
    "HDM": _hdm,
    "HDT": _hdt,
    "THS": _ths,
    "VHW": _vhw,
    "DBT": _dbt,
    "DBS": _dbs,
    "DBK": _dbt,
    "DPT": _dpt,
    "XDR": _xdr,
}
"""By formatter: the last three letters of an address of five, whoever talks."""

PROPRIETARY: Final[dict[str, Callable[[Fields], Statements]]] = {
    "OHPR": _hdm,
    "PASHR": _pashr,
    "PRDID": _prdid,
    "PSXN": _psxn,
    "PTNTHTM": _ptnthtm,
    "PTNTHPR": _ptnthpr,
    "PVRND": _pvrnd,
    "ROV": _rov,
}
"""By whole address.  ``ROV`` is the line of a vehicle's hub: yaw, roll, pitch, depth, altitude, latitude, longitude."""

WITHOUT_CHECKSUM: Final = frozenset({"ROV"})
"""Sentences whose maker never adds a checksum (``...,*`` and the end of the line); they are accepted without."""
