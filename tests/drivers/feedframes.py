"""Frames as devices on feeds send them, for tests."""

from __future__ import annotations

import struct
import zlib
from functools import reduce
from operator import xor

from drivers.keller import with_crc
from drivers.mavlink import LAYOUTS, crc

PRO3_REQUEST = bytes.fromhex("2331000000000010")


def mavlink2(
    number: int, payload: bytes, system: int = 1, component: int = 1, flags: int = 0, signature: bytes = b""
) -> bytes:
    cut = payload.rstrip(b"\0") or payload[:1]
    body = bytes((len(cut), flags, 0, 7, system, component)) + number.to_bytes(3, "little") + cut
    extra = LAYOUTS[number].extra if number in LAYOUTS else 99
    return b"\xfd" + body + crc(body, extra).to_bytes(2, "little") + signature


def mavlink1(number: int, payload: bytes, system: int = 1, component: int = 1) -> bytes:
    body = bytes((len(payload), 7, system, component, number)) + payload
    return b"\xfe" + body + crc(body, LAYOUTS[number].extra).to_bytes(2, "little")


def attitude(yaw_rad: float, boot_ms: int = 1) -> bytes:
    return struct.pack("<Iffffff", boot_ms, 0.1, 0.2, yaw_rad, 0, 0, 0.05)


def scaled_pressure(mbar: float, boot_ms: int = 1) -> bytes:
    return struct.pack("<Iffh", boot_ms, mbar, 0.0, 1934)


def pro3_reply(orientation: int, count: int) -> bytes:
    return b"\x28\x31\x02" + orientation.to_bytes(2, "little") + count.to_bytes(2, "little")


def pro4_packet(flags: int, address: int, payload: bytes, sync: bytes = b"\xfd\xdf") -> bytes:
    long = len(payload) >= 255
    head = sync + bytes((1, flags, address, 255 if long else len(payload)))
    size = len(payload).to_bytes(2, "little")
    extension = size + bytes((size[0] ^ size[1],)) if long else b""
    return head + bytes((reduce(xor, head),)) + extension + payload + bytes((reduce(xor, payload, 0),))


def pro4_words(heading: int, mbar: int) -> bytes:
    words = (heading, 37, -30, mbar)
    return b"\x01" + b"".join(word.to_bytes(2, "little", signed=True) for word in words)


def pro4_navigation(heading: int, mbar: int, flags: int = 2) -> bytes:
    return pro4_packet(flags, 0, pro4_words(heading, mbar))


def pro4_crc_packet(flags: int, address: int, payload: bytes, sync: bytes = b"\xf0\x0f") -> bytes:
    head = sync + bytes((1, flags, address, len(payload)))
    head += zlib.crc32(head).to_bytes(4, "little")
    return head + payload + zlib.crc32(head + payload).to_bytes(4, "little")


def keller_whole_reply(pascals: int, status: int = 0, address: int = 1) -> bytes:
    return with_crc(bytes((address, 74)) + struct.pack(">iB", pascals, status))


def keller_reply(bar: float, status: int = 0, address: int = 1) -> bytes:
    return with_crc(bytes((address, 73)) + struct.pack(">fB", bar, status))
