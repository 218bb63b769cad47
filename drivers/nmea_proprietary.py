"""What sentences of makers' own say: OceanServer, PNI, True North, Honeywell, Teledyne, Kongsberg, Valeport."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from typing import Final

from config.errors import FrameError
from drivers.nmea_fields import (
    UNIT_DEG,
    Dialect,
    Fields,
    Statements,
    number,
    state_heading,
    state_length,
    state_pressure,
    text,
)
from drivers.readings import Quality
from drivers.statements import AnyStatement, Meaning, Moved, Statement

_LETTERS: Final = re.compile(r"C-?\d+(?:\.\d+)?(?:[A-Z][a-z]?-?\d+(?:\.\d+)?)*")
_TAGGED: Final = re.compile(r"([A-Z][a-z]?)(-?\d+(?:\.\d+)?)")
_DBAR_MBAR: Final = 100.0


def read_letters(body: str, dialect: Dialect) -> list[AnyStatement] | None:
    """Return what a sentence of letters and numbers without commas says, None where it is not one."""
    return list(_letters(body, dialect)) if _LETTERS.fullmatch(body) else None


def _pashr(fields: Fields) -> Statements:
    if text(fields, 2) == "T":
        yield from state_heading(Meaning.TRUE, number(fields, 1))


def _ohpr(fields: Fields) -> Statements:
    yield from state_heading(Meaning.MAGNETIC, number(fields, 0))


def _psxn(fields: Fields) -> Statements:
    if text(fields, 0) == "23":
        yield from state_heading(Meaning.TRUE, number(fields, 3))


def _prdid(fields: Fields) -> Statements:
    yield from state_heading(Meaning.TRUE, number(fields, 2))


# Status letters of True North and Honeywell compasses; N is normal, what is not listed says nothing.
_LETTER: Final[dict[str, tuple[Quality, str]]] = {
    "M": ("suspect", "the compass warns: field low (M)"),
    "O": ("suspect", "the compass warns: field high (O)"),
    "C": ("bad", "the compass asks to be calibrated (C)"),
    "L": ("bad", "compass alarm: field low (L)"),
    "P": ("bad", "compass alarm: field high (P)"),
    "V": ("bad", "compass alarm: voltage (V)"),
}


def _tnt(what: Meaning, fields: Fields, unit_deg: float) -> Statements:
    heading = number(fields, 0)
    if heading is None:
        return
    strength = number(fields, 7)
    if strength is not None:
        yield Statement(Meaning.FIELD, strength)
    quality, reason = _LETTER.get(text(fields, 1), ("good", ""))
    yield from state_heading(what, heading if unit_deg == 1.0 else heading * unit_deg % 360.0, quality, reason)


def _has_decimals(fields: Fields) -> bool:
    """In degrees every angle has a decimal point, in 16-bit angles (65536 to the turn) and in mils none."""
    return any("." in field for field in fields[0:5:2])


def _ptnthtm(fields: Fields, dialect: Dialect) -> Statements:
    found = "deg" if _has_decimals(fields) else "bam16"
    yield from _tnt(Meaning.TRUE, fields, UNIT_DEG[found if dialect.angle_unit == "auto" else dialect.angle_unit])


def _ptnthpr(fields: Fields, dialect: Dialect) -> Statements:
    if dialect.angle_unit == "auto" and fields[0].strip() and not _has_decimals(fields):
        raise FrameError("PTNTHPR without decimals is in mils or 16-bit angles; set angle_unit")
    yield from _tnt(Meaning.MAGNETIC, fields, UNIT_DEG.get(dialect.angle_unit, 1.0))


def _pvrnd(fields: Fields) -> Statements:
    yield from state_length(Meaning.DEPTH, number(fields, 2))
    yield from state_heading(Meaning.MAGNETIC, number(fields, 3))


def _rov(fields: Fields) -> Statements:
    yield from state_heading(Meaning.TRUE, number(fields, 0))
    yield from state_length(Meaning.DEPTH, number(fields, 3))
    # A vehicle is never at 0.0 m above the floor: that is an altimeter without an echo.
    yield from state_length(Meaning.ALTITUDE, number(fields, 4) or None)


def _letters(body: str, dialect: Dialect) -> Statements:
    """OceanServer and PNI: C heading, D depth, E error word, field on three axes, without commas."""
    tags = dict(_TAGGED.findall(body))
    axes = [tags[axis] for axis in ("X", "Y", "Z") if axis in tags] or [
        tags[a] for a in ("Mx", "My", "Mz") if a in tags
    ]
    if len(axes) == 3:
        yield Statement(Meaning.FIELD, math.hypot(*(float(axis) for axis in axes)))
    error = int(float(tags.get("E", "0")))
    quality: Quality = "suspect" if error else "good"
    reason = f"the compass reports error word E{error:03d}" if error else ""
    unit_deg = UNIT_DEG.get(dialect.angle_unit, 1.0)
    yield from state_heading(Meaning.MAGNETIC, float(tags["C"]) * unit_deg, quality, reason)
    if "D" in tags:
        yield from state_length(Meaning.DEPTH, float(tags["D"]))


def _pips(fields: Fields) -> Statements:
    """Valeport pressure sensors that convert to metres themselves."""
    if text(fields, 1) == "M":
        yield from state_length(Meaning.DEPTH, number(fields, 0))


def _pvips2(fields: Fields) -> Statements:
    if text(fields, 5) == "M":
        yield from state_length(Meaning.DEPTH, number(fields, 4))


def _prvat(fields: Fields) -> Statements:
    """Valeport altimeter with a pressure sensor, which reads the air's pressure in air."""
    if text(fields, 1) == "M":
        yield from state_length(Meaning.ALTITUDE, number(fields, 0))
    if text(fields, 3) == "DBAR":
        yield from state_pressure(Meaning.ABSOLUTE, number(fields, 2), _DBAR_MBAR)


def _isads(fields: Fields) -> Statements:
    if text(fields, 1) == "M":
        yield from state_length(Meaning.ALTITUDE, number(fields, 0))


def _dvpdl(fields: Fields) -> Statements:
    """Cerulean velocity logs: displacement ahead, right and down in body axes, and a confidence from 0 to 100."""
    dt_us, ahead_m, right_m = number(fields, 1), number(fields, 5), number(fields, 6)
    if dt_us is None or ahead_m is None or right_m is None:
        return
    if number(fields, 8):
        yield Moved(right_m, ahead_m, dt_us * 1e-6)
    else:
        yield Moved(right_m, ahead_m, dt_us * 1e-6, "bad", "the velocity log does not see the floor (confidence 0)")


PROPRIETARY: Final[dict[str, Callable[[Fields], Statements]]] = {
    "DVPDL": _dvpdl,
    "ISADS": _isads,
    "OHPR": _ohpr,
    "PASHR": _pashr,
    "PIPS": _pips,
    "PRDID": _prdid,
    "PRVAT": _prvat,
    "PSXN": _psxn,
    "PVIPS2": _pvips2,
    "PVRND": _pvrnd,
    "ROV": _rov,
}
"""By whole address.  ``ROV`` is the line of a vehicle's hub: yaw, roll, pitch, depth, altitude, latitude, longitude."""

TRUE_NORTH: Final[dict[str, Callable[[Fields, Dialect], Statements]]] = {"PTNTHPR": _ptnthpr, "PTNTHTM": _ptnthtm}
"""By whole address: those whose angles come in several units."""

WITHOUT_CHECKSUM: Final = frozenset({"ROV"})
"""Sentences whose maker never adds a checksum (``...,*`` and the end of the line); they are accepted without."""
