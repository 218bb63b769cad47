"""Keller pressure sensors on their own bus: pressures from replies that somebody asked for.

Function 73 gives them in bar (floating point), function 74 in whole pascals, function 69 the sensor's serial number.

Requests and replies share the line: adapters give back what is sent, and another program's requests may be heard.
They are told apart by their function, size and checksum (the one of Modbus, but with its high byte first).
"""

from __future__ import annotations

import math
import re
import struct
from typing import Final

from config.errors import FrameError
from config.schema import Feed
from drivers.framed import FrameReader, Said
from drivers.statements import Meaning, Statement
from drivers.wire import MORE, byte_ns

_START: Final = re.compile(rb"[\x01-\xfa]")
_INITIALISE: Final = 48
_SERIAL: Final = 69
_READ: Final = 73
_READ_WHOLE: Final = 74
_REFUSED: Final = 0x80
_REFUSAL_SIZE: Final = 5
_SIZES: Final = {30: (5, 8), _INITIALISE: (4, 10), _SERIAL: (4, 8), _READ: (5, 9), _READ_WHOLE: (5, 9), 95: (5, 9)}
"""Sizes of requests and replies by function (30 reads a coefficient, 95 sets a zero: heard, never sent)."""
_ANY: Final = 250
"""Address that any single sensor heeds."""
_STANDARD_CHECK: Final = 0x80
_MBAR_PER_BAR: Final = 1000.0
_MBAR_PER_PA: Final = 0.01


def crc16(data: bytes | bytearray) -> int:
    """Checksum over polynomial A001, reflected, start FFFF."""
    total = 0xFFFF
    for byte in data:
        total ^= byte
        for _ in range(8):
            total = (total >> 1) ^ (0xA001 if total & 1 else 0)
    return total


def with_crc(body: bytes) -> bytes:
    """Put the checksum behind a message, high byte first."""
    return body + crc16(body).to_bytes(2, "big")


def initialise(address: int) -> bytes:
    """Ask a sensor to get ready, as it must be after each start; nothing in it is changed."""
    return with_crc(bytes((address, _INITIALISE)))


def read_serial(address: int) -> bytes:
    """Ask a sensor for its serial number."""
    return with_crc(bytes((address, _SERIAL)))


def read_channel(address: int, channel: int, *, whole: bool = False) -> bytes:
    """Ask a sensor for a channel: 0 calculated, 1 P1, 2 P2; with ``whole`` in whole pascals."""
    return with_crc(bytes((address, _READ_WHOLE if whole else _READ, channel)))


def judge(buffer: bytearray, at: int, _is_synced: bool) -> int | str:
    """Judge the bytes at ``at`` as a request, a reply or a refusal (`drivers.wire.Judge`)."""
    if len(buffer) < at + 2:
        return MORE
    function = buffer[at + 1]
    sizes = _SIZES.get(function & ~_REFUSED)
    if sizes is None:
        return ""
    for size in (_REFUSAL_SIZE,) if function & _REFUSED else sizes:
        if len(buffer) < at + size:
            return MORE
        if crc16(buffer[at : at + size - 2]) == int.from_bytes(buffer[at + size - 2 : at + size], "big"):
            return size
    return ""


class Keller:
    """Pressures of the configured channel; which one a reply holds is known from the request before it, if heard.

    Counted are ``reply``, ``serial``, ``request``, ``other`` and ``other_sensor`` (or channel); a refusal is
    ``exception_32`` where the sensor was not initialised.
    """

    def __init__(self, feed: Feed) -> None:
        self._address = feed.address
        self._channel = self._asked = feed.channel
        self.serial: int | None = None
        """Serial number of the configured sensor, where it was told."""

    def read(self, frame: bytes) -> Said:
        """Return the name of a frame and what it says."""
        function = frame[1]
        if function & _REFUSED:
            raise FrameError(f"exception_{frame[2]}")
        if len(frame) == _SIZES[function][0]:
            self._asked = frame[2] if function in (_READ, _READ_WHOLE) else self._asked
            return "request", ()
        is_ours = self._address in (_ANY, frame[0])
        if function == _SERIAL and is_ours:
            self.serial = int.from_bytes(frame[2:6], "big")
            return "serial", ()
        if function not in (_READ, _READ_WHOLE):
            return "other", ()
        if not is_ours or self._asked != self._channel:
            return "other_sensor", ()
        return "reply", (self._pressure(frame),)

    def _pressure(self, frame: bytes) -> Statement:
        mbar, status = _mbar(frame), frame[6]
        if not math.isfinite(mbar):
            raise FrameError("field")
        if status & 1 << self._channel:
            return Statement(Meaning.PRESSURE, mbar, "bad", "the sensor calls its channel invalid")
        if status & _STANDARD_CHECK:
            return Statement(Meaning.PRESSURE, mbar, "suspect", "the sensor's own check failed")
        return Statement(Meaning.PRESSURE, mbar)


def _mbar(frame: bytes) -> float:
    if frame[1] == _READ_WHOLE:
        return int.from_bytes(frame[2:6], "big", signed=True) * _MBAR_PER_PA
    (bar,) = struct.unpack_from(">f", frame, 2)
    return float(bar) * _MBAR_PER_BAR


def keller_reader(feed: Feed) -> FrameReader:
    """Return the reader of a Keller sensor's line."""
    return FrameReader(_START, judge, Keller(feed), byte_ns(feed))
