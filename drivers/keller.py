"""Keller pressure sensors on their own bus (function 73): pressures in bar, from replies that somebody asked for.

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
_READ: Final = 73
_REFUSED: Final = 0x80
_REFUSAL_SIZE: Final = 5
_SIZES: Final = {30: (5, 8), 48: (4, 10), 69: (4, 8), _READ: (5, 9), 74: (5, 9), 95: (5, 9)}
"""Sizes of requests and replies by function."""
_ANY: Final = 250
"""Address that any single sensor heeds."""
_STANDARD_CHECK: Final = 0x80
_MBAR_PER_BAR: Final = 1000.0


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
    return with_crc(bytes((address, 48)))


def read_channel(address: int, channel: int) -> bytes:
    """Ask a sensor for a channel: 0 calculated, 1 P1, 2 P2."""
    return with_crc(bytes((address, _READ, channel)))


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

    Counted are ``reply``, ``request``, ``other`` and ``other_sensor`` (or channel); a refusal is ``exception_32`` where
    the sensor was not initialised.
    """

    def __init__(self, feed: Feed) -> None:
        self._address = feed.address
        self._channel = self._asked = feed.channel

    def read(self, frame: bytes) -> Said:
        """Return the name of a frame and what it says."""
        function = frame[1]
        if function & _REFUSED:
            raise FrameError(f"exception_{frame[2]}")
        if len(frame) == _SIZES[function][0]:
            self._asked = frame[2] if function == _READ else self._asked
            return "request", ()
        if function != _READ:
            return "other", ()
        if self._address not in (_ANY, frame[0]) or self._asked != self._channel:
            return "other_sensor", ()
        return "reply", (self._pressure(frame),)

    def _pressure(self, frame: bytes) -> Statement:
        (bar,) = struct.unpack_from(">f", frame, 2)
        if not math.isfinite(bar):
            raise FrameError("field")
        mbar, status = bar * _MBAR_PER_BAR, frame[6]
        if status & 1 << self._channel:
            return Statement(Meaning.PRESSURE, mbar, "bad", "the sensor calls its channel invalid")
        if status & _STANDARD_CHECK:
            return Statement(Meaning.PRESSURE, mbar, "suspect", "the sensor's own check failed")
        return Statement(Meaning.PRESSURE, mbar)


def keller_reader(feed: Feed) -> FrameReader:
    """Return the reader of a Keller sensor's line."""
    return FrameReader(_START, judge, Keller(feed), byte_ns(feed))
