"""VideoRay Pro 4 (PRO4 protocol): heading and water pressure from the vehicle's replies.

A packet is two bytes of synchronisation, id, flags, address, length, the exclusive or of these six, payload, and the
exclusive or of the payload.  Length 255 announces a longer one: two bytes, little-endian, and their exclusive or.

Newer vehicles of the maker use other synchronisation and CRC-32 in the place of both checksums, else the same packets.

Whoever asks, the replies are read: beside VideoRay's own program, or polled by `drivers.polls` with a request that
carries no data and so writes nothing.
"""

from __future__ import annotations

import re
import struct
import zlib
from functools import reduce
from operator import xor
from typing import Final

from config.errors import FrameError
from config.schema import Feed
from drivers.framed import FrameReader, Said
from drivers.statements import Meaning, Statement
from drivers.wire import MORE, byte_ns

_REQUESTS: Final = (b"\xfa\xaf", b"\xf5\x5f")
_RESPONSES: Final = (b"\xfd\xdf", b"\xf0\x0f")
_CRC_SYNCS: Final = (_REQUESTS[1], _RESPONSES[1])
_START: Final = re.compile(rb"[\xfa\xfd\xf5\xf0]")
_FIELDS: Final = 6
"""Bytes of the head before its checksum: synchronisation, id, flags, address, length."""
_CRC: Final = 4
_EXTENDED: Final = 255
_LARGEST: Final = 4096
_VEHICLE: Final = 1
"""Device type of the vehicle, first byte of a payload."""
_NAVIGATION: Final = 9
"""Bytes of device type, heading, pitch, roll and depth, with which every reply to a navigation request begins."""
_DUMP: Final = 0x80
_PRESSURE_AT: Final = 0x66

NAVIGATION_REQUEST: Final = bytes.fromhex("faaf010500005100")
"""Asks for navigation and health with no data of its own: nothing in the vehicle is written."""
NAVIGATION_REQUEST_CRC: Final = bytes.fromhex("f55f01050000")
"""The same for newer vehicles, still without its checksums: see `navigation_request`."""


def navigation_request(*, crc: bool) -> bytes:
    """Return the request for navigation, as the vehicle's generation checks it."""
    if not crc:
        return NAVIGATION_REQUEST
    head = _with_crc(NAVIGATION_REQUEST_CRC)
    return _with_crc(head)


def judge(buffer: bytearray, at: int, _is_synced: bool) -> int | str:
    """Judge the bytes at ``at`` as a packet, either way (`drivers.wire.Judge`)."""
    sync = bytes(buffer[at : at + 2])
    if len(sync) < 2:
        return MORE
    if sync not in _REQUESTS and sync not in _RESPONSES:
        return ""
    return _judge_crc(buffer, at) if sync in _CRC_SYNCS else _judge_xor(buffer, at)


def _judge_xor(buffer: bytearray, at: int) -> int | str:
    head = bytes(buffer[at : at + _FIELDS + 1])
    if len(head) < _FIELDS + 1:
        return MORE
    if reduce(xor, head):
        return "header"
    start, length = at + _FIELDS + 1, head[5]
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


def _judge_crc(buffer: bytearray, at: int) -> int | str:
    """CRC-32 of the first six bytes, then of all before; packets of extended length are described nowhere."""
    start = at + _FIELDS + _CRC
    if len(buffer) < start:
        return MORE
    length = buffer[at + 5]
    if length == _EXTENDED or not _is_whole(buffer[at:start]):
        return "header"
    end = start + length + _CRC
    if len(buffer) < end:
        return MORE
    return end - at if _is_whole(buffer[at:end]) else "checksum"


def _is_whole(packet: bytearray) -> bool:
    return zlib.crc32(packet[:-_CRC]) == int.from_bytes(packet[-_CRC:], "little")


def _with_crc(body: bytes) -> bytes:
    return body + zlib.crc32(body).to_bytes(_CRC, "little")


class Pro4:
    """Headings and pressures in the vehicle's replies.

    Counted are ``navigation`` and ``registers`` (replies with both), ``other``, and ``request`` of whoever asks.
    """

    def __init__(self, feed: Feed) -> None:
        # Tenths of a degree but for early firmware.
        self._unit_deg = 1.0 if feed.angle_unit == "deg" else 0.1

    def read(self, frame: bytes) -> Said:
        """Return the name of a packet and what it says."""
        if frame[:2] in _REQUESTS:
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
    payload = _payload(packet)
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


def _payload(packet: bytes) -> bytes:
    if packet[:2] in _CRC_SYNCS:
        return packet[_FIELDS + _CRC : -_CRC]
    return packet[_FIELDS + 4 : -1] if packet[5] == _EXTENDED else packet[_FIELDS + 1 : -1]
