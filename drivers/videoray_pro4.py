"""VideoRay Pro 4 (PRO4 protocol): heading and water pressure from the vehicle's replies.

A packet is two bytes of synchronisation, id, flags, address, length, the exclusive or of these six, payload, and the
exclusive or of the payload.  Length 255 announces a longer one: two bytes, little-endian, and their exclusive or.

Whoever asks, the replies are read: beside VideoRay's own program, or polled by `drivers.polls` with a request that
carries no data and so writes nothing.
"""

from __future__ import annotations

import re
import struct
from functools import reduce
from operator import xor
from typing import Final

from config.errors import FrameError
from config.schema import Feed
from drivers.framed import FrameReader, Said
from drivers.statements import Meaning, Statement
from drivers.wire import MORE, byte_ns

_REQUEST: Final = b"\xfa\xaf"
_RESPONSE: Final = b"\xfd\xdf"
_START: Final = re.compile(rb"[\xfa\xfd]")
_HEAD: Final = 7
_EXTENDED: Final = 255
_LARGEST: Final = 4096
_VEHICLE: Final = 1
"""Device type of the vehicle, first byte of a payload."""
_NAVIGATION: Final = 9
"""Bytes of device type, heading, pitch, roll and depth, with which every reply to a navigation request begins."""
_DUMP: Final = 0x80
_PRESSURE_AT: Final = 0x66
_HEADING_AT: Final = 0x68

NAVIGATION_REQUEST: Final = bytes.fromhex("faaf010500005100")
"""Asks for navigation and health with no data of its own: nothing in the vehicle is written."""


def judge(buffer: bytearray, at: int, _is_synced: bool) -> int | str:
    """Judge the bytes at ``at`` as a packet, either way (`drivers.wire.Judge`)."""
    head = bytes(buffer[at : at + _HEAD])
    if len(head) >= 2 and head[:2] not in (_REQUEST, _RESPONSE):
        return ""
    if len(head) < _HEAD:
        return MORE
    if reduce(xor, head):
        return "header"
    start, length = at + _HEAD, head[5]
    if length == _EXTENDED:
        extension = buffer[start : start + 3]
        if len(extension) < 3:
            return MORE
        start, length = start + 3, int.from_bytes(extension[:2], "little")
        if reduce(xor, extension) or length > _LARGEST:
            return "header"
    if len(buffer) < start + length + 1:
        return MORE
    return "checksum" if reduce(xor, buffer[start : start + length + 1]) else start + length + 1 - at


class Pro4:
    """Headings and pressures in the vehicle's replies.

    Counted are ``navigation`` and ``registers`` (replies with both), ``other``, and ``request`` of whoever asks.
    """

    def __init__(self, feed: Feed) -> None:
        # Tenths of a degree but for early firmware.
        self._unit_deg = 1.0 if feed.angle_unit == "deg" else 0.1

    def read(self, frame: bytes) -> Said:
        """Return the name of a packet and what it says."""
        if frame[:2] == _REQUEST:
            return "request", ()
        found = _navigation(frame)
        if found is None:
            return "other", ()
        name, heading, mbar = found
        if abs(heading * self._unit_deg) > 360.0:
            raise FrameError("field")
        return name, (Statement(Meaning.MAGNETIC, heading * self._unit_deg), Statement(Meaning.ABSOLUTE, float(mbar)))


def pro4_reader(feed: Feed) -> FrameReader:
    """Return the reader of a Pro 4's line."""
    return FrameReader(_START, judge, Pro4(feed), byte_ns(feed))


def _navigation(packet: bytes) -> tuple[str, int, int] | None:
    """Return kind, raw heading and pressure of a response that holds both."""
    flags, address = packet[3], packet[4]
    payload = packet[_HEAD + 3 : -1] if packet[5] == _EXTENDED else packet[_HEAD:-1]
    if not payload or payload[0] != _VEHICLE:
        return None
    if flags & _DUMP:
        at = 1 + _PRESSURE_AT - address
        if at < 1 or at + 4 > len(payload):
            return None
        mbar, heading = struct.unpack_from("<hh", payload, at)
        return "registers", heading, mbar
    if 1 <= flags <= 5 and address == 0 and len(payload) >= _NAVIGATION:
        heading, _pitch, _roll, mbar = struct.unpack_from("<4h", payload, 1)
        return "navigation", heading, mbar
    return None
