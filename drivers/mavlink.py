"""MAVLink 1 and 2, listened to: heading, depth and way of an autopilot (ArduSub), without ever sending a byte.

A frame's checksum (X.25) also covers a byte that each message's layout has for its own, so only messages that are
known here can be checked.  An unknown one is believed, and skipped whole, where it stands between frames.
Signatures are accepted, not verified.

Depth comes from a pressure message: altitudes of an autopilot are above mean sea level or hang on where it was armed.
"""

from __future__ import annotations

import math
import re
import struct
from dataclasses import dataclass
from typing import Final

from config.errors import FrameError
from config.schema import Feed
from drivers.framed import FrameReader, Said
from drivers.readings import Quality
from drivers.statements import Located, Meaning, Moved, Statement
from drivers.wire import MORE, byte_ns

_V1: Final = 0xFE
_V2: Final = 0xFD
_START: Final = re.compile(rb"[\xfd\xfe]")
_SIGNED: Final = 1
_SIGNATURE: Final = 13
_EXTENSION: Final = 16
"""Bytes that newer programs may have added to a message: none of those known here has gained more than four."""
_AUTOPILOT: Final = 1
"""Component number of an autopilot."""

_VEHICLES: Final = {2: "quadrotor", 6: "ground station", 10: "rover", 11: "boat", 12: "submarine"}
_MAKERS: Final = {3: "ArduPilot", 12: "PX4"}
_MOST_MBAR: Final = 1e7
_WAYS: Final = frozenset({"LOCAL_POSITION_NED", "VISION_POSITION_DELTA"})
_PRESSURES: Final = {"SCALED_PRESSURE": 1, "SCALED_PRESSURE2": 2, "SCALED_PRESSURE3": 3}


@dataclass(frozen=True, slots=True)
class Layout:
    """A message: its name, its checksum's own byte, its size in MAVLink 1; version 2 may cut zeros or add fields."""

    name: str
    extra: int
    size: int


LAYOUTS: Final = {
    0: Layout("HEARTBEAT", 50, 9),
    2: Layout("SYSTEM_TIME", 137, 12),
    27: Layout("RAW_IMU", 144, 26),
    29: Layout("SCALED_PRESSURE", 115, 14),
    30: Layout("ATTITUDE", 39, 28),
    32: Layout("LOCAL_POSITION_NED", 185, 28),
    33: Layout("GLOBAL_POSITION_INT", 104, 28),
    74: Layout("VFR_HUD", 20, 20),
    137: Layout("SCALED_PRESSURE2", 195, 14),
    143: Layout("SCALED_PRESSURE3", 131, 14),
    178: Layout("AHRS2", 47, 24),
    11011: Layout("VISION_POSITION_DELTA", 106, 44),
}


def crc(data: bytes | bytearray, extra: int) -> int:
    """Checksum X.25 (start FFFF, nothing added at the end) of ``data`` and the message's own byte."""
    total = 0xFFFF
    for byte in (*data, extra):
        mixed = (byte ^ total) & 0xFF
        mixed ^= (mixed << 4) & 0xFF
        total = (total >> 8) ^ (mixed << 8) ^ (mixed << 3) ^ (mixed >> 4)
    return total


def judge(buffer: bytearray, at: int, is_synced: bool) -> int | str:
    """Judge the bytes at ``at`` as a frame of either version (`drivers.wire.Judge`)."""
    is_v1 = buffer[at] == _V1
    head = 6 if is_v1 else 10
    if len(buffer) < at + head:
        return MORE
    if not is_v1 and buffer[at + 2] & ~_SIGNED:
        return ""  # flags that must be understood and are not
    number = buffer[at + 5] if is_v1 else int.from_bytes(buffer[at + 7 : at + 10], "little")
    unsigned = head + buffer[at + 1] + 2
    size = unsigned + (_SIGNATURE if not is_v1 and buffer[at + 2] & _SIGNED else 0)
    layout = LAYOUTS.get(number)
    if layout is None:
        return _judge_unknown(buffer, at + size, size, is_synced)
    if buffer[at + 1] != layout.size if is_v1 else buffer[at + 1] > layout.size + _EXTENSION:
        return ""
    if len(buffer) < at + unsigned:
        return MORE
    told = int.from_bytes(buffer[at + unsigned - 2 : at + unsigned], "little")
    if crc(buffer[at + 1 : at + unsigned - 2], layout.extra) != told:
        return "checksum"
    return size if len(buffer) >= at + size else MORE


def _judge_unknown(buffer: bytearray, end: int, size: int, is_synced: bool) -> int | str:
    if not is_synced:
        return ""
    if len(buffer) <= end:
        return MORE
    return size if buffer[end] in (_V1, _V2) else ""


@dataclass(frozen=True, slots=True)
class _Frame:
    """One frame, taken apart; ``payload`` has its full size again."""

    name: str
    system: int
    component: int
    payload: bytes


def _taken_apart(data: bytes) -> _Frame:
    is_v1 = data[0] == _V1
    head = 6 if is_v1 else 10
    number = data[5] if is_v1 else int.from_bytes(data[7:10], "little")
    layout = LAYOUTS.get(number, Layout("other", 0, 0))
    system, component = (data[3], data[4]) if is_v1 else (data[5], data[6])
    payload = data[head : head + data[1]].ljust(layout.size, b"\0")
    return _Frame(layout.name, system, component, payload)


class Mavlink:
    """Messages of one vehicle's autopilot: the configured system, else the first one heard.

    Counted are the vehicle's messages by name, ``other``, and ``other_system``.
    """

    def __init__(self, feed: Feed) -> None:
        self._system = feed.system
        self._heading_from = feed.heading_from.upper()
        self._pressure_message = feed.pressure_message
        self._boot_ms: dict[str, int] = {}
        self.speaker = ""
        """What the vehicle's heartbeat says it is."""

    def read(self, frame: bytes) -> Said:
        """Return the name of a message and what it says."""
        taken = _taken_apart(frame)
        if self._system is None and taken.component == _AUTOPILOT and taken.name != "other":
            self._system = taken.system
        # A velocity log's driver is a component of its own beside the autopilot.
        is_ours = taken.component == _AUTOPILOT or taken.name == "VISION_POSITION_DELTA"
        if taken.system != self._system or not is_ours:
            return "other_system", ()
        said = _way(taken) if taken.name in _WAYS else self._statement(taken)
        return taken.name, () if said is None else (said,)

    def _statement(self, frame: _Frame) -> Statement | None:
        name, payload = frame.name, frame.payload
        if name == "HEARTBEAT":
            vehicle, maker = _VEHICLES.get(payload[4], "vehicle"), _MAKERS.get(payload[5], "an autopilot")
            self.speaker = f"system {frame.system}: {vehicle} with {maker}"
        elif name == "RAW_IMU":
            return Statement(Meaning.FIELD, math.hypot(*struct.unpack_from("<hhh", payload, 20)))
        elif name == "VFR_HUD" and name == self._heading_from:
            return _checked(Meaning.MAGNETIC, struct.unpack_from("<h", payload, 16)[0], 360.0)
        elif name == "ATTITUDE" and name == self._heading_from:
            yaw_deg = math.degrees(struct.unpack_from("<f", payload, 12)[0])
            return _checked(Meaning.MAGNETIC, yaw_deg, 360.0, *self._freshness(frame))
        elif _PRESSURES.get(name) == self._pressure_message:
            mbar = struct.unpack_from("<f", payload, 4)[0]
            return _checked(Meaning.ABSOLUTE, mbar, _MOST_MBAR, *self._freshness(frame))
        return None

    def _freshness(self, frame: _Frame) -> tuple[Quality, str]:
        """Compare the autopilot's own time with that of its message before."""
        boot_ms = int.from_bytes(frame.payload[:4], "little")
        stands = self._boot_ms.get(frame.name) == boot_ms
        self._boot_ms[frame.name] = boot_ms
        return ("suspect", "stale: the autopilot's clock stands still") if stands else ("good", "")


def _way(frame: _Frame) -> Moved | Located:
    """Read a displacement (ahead, right, down in body axes), or a place north, east and below an origin."""
    if frame.name == "VISION_POSITION_DELTA":
        _, dt_us, *_, ahead_m, right_m, _, confidence = struct.unpack("<QQ7f", frame.payload[:44])
        if not all(map(math.isfinite, (ahead_m, right_m))):
            raise FrameError("field")
        if confidence > 0.0:
            return Moved(right_m, ahead_m, dt_us * 1e-6)
        return Moved(right_m, ahead_m, dt_us * 1e-6, "bad", "the sender is not sure at all (confidence 0)")
    boot_ms, north_m, east_m = struct.unpack_from("<Iff", frame.payload)
    if not all(map(math.isfinite, (north_m, east_m))):
        raise FrameError("field")
    return Located(east_m, north_m, boot_ms * 1e-3)


def _checked(what: Meaning, value: float, most: float, quality: Quality = "good", reason: str = "") -> Statement:
    if not abs(value) <= most:  # not a number, too
        raise FrameError("field")
    return Statement(what, value, quality, reason)


def mavlink_reader(feed: Feed) -> FrameReader:
    """Return the reader of an autopilot's line."""
    return FrameReader(_START, judge, Mavlink(feed), byte_ns(feed))
