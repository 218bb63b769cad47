"""Keller pressure sensors on their own bus (function 73): pressures in bar, from replies that somebody asked for.

Requests and replies share the line: adapters give back what is sent, and another program's requests may be heard.
They are told apart by their function, size and checksum (the one of Modbus, but with its high byte first).
"""

from __future__ import annotations

import math
import re
import struct
from collections import Counter
from typing import Final

from config.schema import Feed
from drivers.counters import Counters
from drivers.statements import Message, Said, Statement
from drivers.wire import MORE, Cut, Cutter, byte_ns

_START: Final = re.compile(rb"[\x01-\xfa]")
_READ: Final = 73
_REFUSED: Final = 0x80
_REFUSAL_SIZE: Final = 5
_SIZES: Final = {30: (5, 8), 48: (4, 10), 69: (4, 8), _READ: (5, 9), 74: (5, 9), 95: (5, 9)}
"""Sizes of requests and replies by function."""
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


class KellerReader:
    """Pressures of the configured channel; which one a reply holds is known from the request before it, if heard."""

    def __init__(self, feed: Feed) -> None:
        self._address = feed.address
        self._channel = self._asked = feed.channel
        self._cutter = Cutter(_START, judge, byte_ns(feed))
        self._frames: Counter[str] = Counter()
        self._bad: Counter[str] = Counter()

    @property
    def counters(self) -> Counters:
        """What was seen so far; a refusal is ``exception_32`` where the sensor was not initialised."""
        return Counters(dict(self._frames), self._cutter.skipped, dict(self._cutter.bad + self._bad))

    def push(self, t_ns: int, data: bytes) -> list[Message]:
        """Take bytes that arrived at ``t_ns`` and return the messages that they complete."""
        return [message for cut in self._cutter.push(t_ns, data) for message in self._read(cut)]

    def finish(self) -> list[Message]:
        """End the stream."""
        return [message for cut in self._cutter.finish() for message in self._read(cut)]

    def _read(self, cut: Cut) -> list[Message]:
        function, size = cut.data[1], len(cut.data)
        if function & _REFUSED:
            self._bad[f"exception_{cut.data[2]}"] += 1
        elif size == _SIZES[function][0]:
            self._frames["request"] += 1
            if function == _READ:
                self._asked = cut.data[2]
        elif function != _READ:
            self._frames["other"] += 1
        elif self._address not in (250, cut.data[0]) or self._asked != self._channel:
            self._frames["other_sensor"] += 1
        else:
            self._frames["reply"] += 1
            return self._reply(cut)
        return []

    def _reply(self, cut: Cut) -> list[Message]:
        (bar,) = struct.unpack_from(">f", cut.data, 2)
        status = cut.data[6]
        if not math.isfinite(bar):
            self._bad["field"] += 1
            return []
        if status & 1 << self._channel:
            said = Statement(Said.PRESSURE, bar * _MBAR_PER_BAR, "bad", "the sensor calls its channel invalid")
        elif status & _STANDARD_CHECK:
            said = Statement(Said.PRESSURE, bar * _MBAR_PER_BAR, "suspect", "the sensor's own check failed")
        else:
            said = Statement(Said.PRESSURE, bar * _MBAR_PER_BAR)
        return [Message(cut.t_ns, "reply", (said,))]
