"""What each standard sentence says about heading, depth and altitude (NMEA 0183).

A null field means that a quantity is not available: it gives nothing, never zero.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from config.errors import FrameError
from drivers.nmea_fields import Dialect, Fields, Statements, number, state_heading, state_length, state_pressure, text
from drivers.nmea_proprietary import PROPRIETARY, TRUE_NORTH, read_letters
from drivers.statements import AnyStatement, Meaning, Statement

_FOOT_M: Final = 0.3048
_FATHOM_M: Final = 1.8288
_MBAR: Final = {"B": 1000.0, "P": 0.01}


def read(address: str, fields: Fields, dialect: Dialect) -> tuple[str, list[AnyStatement]] | None:
    """Name of a sentence and what it says, or None for one that says nothing about heading or depth.

    ``address`` is the first field, without ``$``.  Raises FrameError for a field that is not what it must be.
    """
    letters = read_letters(address, dialect) if not fields else None
    if letters is not None:
        return "C", letters
    if address in TRUE_NORTH:
        return address, list(TRUE_NORTH[address](fields, dialect))
    if address in PROPRIETARY:
        return address, list(PROPRIETARY[address](fields))
    name = address[2:] if len(address) == 5 and (not dialect.talker or address.startswith(dialect.talker)) else ""
    if name == "XDR":
        return name, list(_xdr(fields, dialect))
    return (name, list(STANDARD[name](fields))) if name in STANDARD else None


def _toward(value: float | None, letter: str) -> float:
    """Signed angle of a value with E or W; nothing is zero."""
    if not value:
        return 0.0
    if letter not in ("E", "W"):
        raise FrameError(f"{value} needs E or W, got {letter!r}")
    return value if letter == "E" else -value


def _hdg(fields: Fields) -> Statements:
    heading = number(fields, 0)
    # Compasses that know no variation write 0.0 as often as nothing.
    variation = _toward(number(fields, 3), text(fields, 4))
    if variation:
        yield Statement(Meaning.VARIATION, variation)
    if heading is not None:
        corrected = heading + _toward(number(fields, 1), text(fields, 2))
        yield from state_heading(Meaning.MAGNETIC, corrected % 360.0 if abs(heading) <= 360.0 else heading)


def _hdm(fields: Fields) -> Statements:
    yield from state_heading(Meaning.MAGNETIC, number(fields, 0))


def _hdt(fields: Fields) -> Statements:
    yield from state_heading(Meaning.TRUE, number(fields, 0))


def _ths(fields: Fields) -> Statements:
    # A autonomous, E estimated; not M (typed in by hand), S (simulator), V (invalid).
    mode = text(fields, 1)
    if mode == "A":
        yield from _hdt(fields)
    elif mode == "E":
        yield from state_heading(Meaning.TRUE, number(fields, 0), "suspect", "estimated by the compass (mode E)")


def _vhw(fields: Fields) -> Statements:
    true = number(fields, 0)
    if true is not None:
        yield from state_heading(Meaning.TRUE, true)
    else:
        yield from state_heading(Meaning.MAGNETIC, number(fields, 2))


def _metres(fields: Fields) -> float | None:
    for at, unit_m in ((2, 1.0), (0, _FOOT_M), (4, _FATHOM_M)):
        value = number(fields, at)
        if value is not None:
            return value * unit_m
    return None


def _dbt(fields: Fields) -> Statements:
    yield from state_length(Meaning.BELOW_SURFACE, _metres(fields))
    yield from state_length(Meaning.ABOVE_FLOOR, _metres(fields))


def _dbs(fields: Fields) -> Statements:
    yield from state_length(Meaning.BELOW_SURFACE, _metres(fields))


def _dpt(fields: Fields) -> Statements:
    below = number(fields, 0)
    if below is None:
        return
    # A positive offset is from the transducer up to the waterline; a negative one is to the keel.
    offset = max(number(fields, 1) or 0.0, 0.0)
    yield from state_length(Meaning.BELOW_SURFACE, below + offset)
    yield from state_length(Meaning.ABOVE_FLOOR, below)


def _xdr(fields: Fields, dialect: Dialect) -> Statements:
    """Take distances and pressures by the name of their transducer: by its type it may be the weather's."""
    for at in range(0, len(fields) - 3, 4):
        kind, unit, name = text(fields, at), text(fields, at + 2), text(fields, at + 3)
        if kind == "D" and unit == "M" and name in dialect.depth_names:
            yield from state_length(Meaning.DEPTH, number(fields, at + 1))
        elif kind == "P" and unit in _MBAR and name in dialect.pressure_names:
            yield from state_pressure(Meaning.PRESSURE, number(fields, at + 1), _MBAR[unit])


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
}
"""By formatter: the last three letters of an address of five, whoever talks."""
