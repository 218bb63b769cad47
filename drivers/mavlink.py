"""MAVLink 1 and 2, listened to: heading and depth of an autopilot (ArduSub), without ever sending a byte.

A frame's checksum (X.25) also covers a byte that each message's layout has for its own, so only messages that are
known here can be checked.  An unknown one is believed, and skipped whole, where it stands between frames.
Signatures are accepted, not verified.

Depth comes from a pressure message: altitudes of an autopilot are above mean sea level or hang on where it was armed.
"""

from __future__ import annotations

import math
import re
import struct
from collections import Counter
from dataclasses import dataclass
from typing import Final

from config.schema import Feed
from drivers.counters import Counters
from drivers.readings import Quality
from drivers.statements import Message, Said, Statement
from drivers.wire import MORE, Cut, Cutter, byte_ns

_V1: Final = 0xFE
_V2: Final = 0xFD
_START: Final = re.compile(rb"[\xfd\xfe]")
_SIGNED: Final = 1
_SIGNATURE: Final = 13
_AUTOPILOT: Final = 1
"""Component number of an autopilot."""

_VEHICLES: Final = {2: "quadrotor", 6: "ground station", 10: "rover", 11: "boat", 12: "submarine"}
_MAKERS: Final = {3: "ArduPilot", 12: "PX4"}
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
    33: Layout("GLOBAL_POSITION_INT", 104, 28),
    74: Layout("VFR_HUD", 20, 20),
    137: Layout("SCALED_PRESSURE2", 195, 14),
    143: Layout("SCALED_PRESSURE3", 131, 14),
    178: Layout("AHRS2", 47, 24),
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
    if is_v1 and buffer[at + 1] != layout.size:
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


def _frame(data: bytes) -> _Frame:
    is_v1 = data[0] == _V1
    head = 6 if is_v1 else 10
    number = data[5] if is_v1 else int.from_bytes(data[7:10], "little")
    layout = LAYOUTS.get(number, Layout("other", 0, 0))
    system, component = (data[3], data[4]) if is_v1 else (data[5], data[6])
    payload = data[head : head + data[1]].ljust(layout.size, b"\0")
    return _Frame(layout.name, system, component, payload)


class MavlinkReader:
    """Messages of one vehicle's autopilot: the configured system, else the first one heard."""

    def __init__(self, feed: Feed) -> None:
        self._system = feed.system
        self._heading_from = feed.heading_from.upper()
        self._pressure_message = feed.pressure_message
        self._cutter = Cutter(_START, judge, byte_ns(feed))
        self._frames: Counter[str] = Counter()
        self._bad: Counter[str] = Counter()
        self._boot_ms: dict[str, int] = {}
        self.speaker = ""
        """What the vehicle's heartbeat says it is."""

    @property
    def counters(self) -> Counters:
        """What was seen so far: the vehicle's messages by name, ``other``, and ``other_system``."""
        return Counters(dict(self._frames), self._cutter.skipped, dict(self._cutter.bad + self._bad))

    def push(self, t_ns: int, data: bytes) -> list[Message]:
        """Take bytes that arrived at ``t_ns`` and return the messages that they complete."""
        return [message for cut in self._cutter.push(t_ns, data) for message in self._read(cut)]

    def finish(self) -> list[Message]:
        """End the stream."""
        return [message for cut in self._cutter.finish() for message in self._read(cut)]

    def _read(self, cut: Cut) -> list[Message]:
        frame = _frame(cut.data)
        if self._system is None and frame.component == _AUTOPILOT and frame.name != "other":
            self._system = frame.system
        if (frame.system, frame.component) != (self._system, _AUTOPILOT):
            self._frames["other_system"] += 1
            return []
        self._frames[frame.name] += 1
        statement = self._statement(frame)
        return [] if statement is None else [Message(cut.t_ns, frame.name, (statement,))]

    def _statement(self, frame: _Frame) -> Statement | None:
        name, payload = frame.name, frame.payload
        if name == "HEARTBEAT":
            vehicle, maker = _VEHICLES.get(payload[4], "vehicle"), _MAKERS.get(payload[5], "an autopilot")
            self.speaker = f"system {frame.system}: {vehicle} with {maker}"
        elif name == "RAW_IMU":
            return Statement(Said.FIELD, math.hypot(*struct.unpack_from("<hhh", payload, 20)))
        elif name == "VFR_HUD" and name == self._heading_from:
            return self._number(Said.MAGNETIC, struct.unpack_from("<h", payload, 16)[0], 360.0)
        elif name == "ATTITUDE" and name == self._heading_from:
            yaw_deg = math.degrees(struct.unpack_from("<f", payload, 12)[0])
            return self._number(Said.MAGNETIC, yaw_deg, 360.0, *self._freshness(frame))
        elif _PRESSURES.get(name) == self._pressure_message:
            mbar = struct.unpack_from("<f", payload, 4)[0]
            return self._number(Said.ABSOLUTE, mbar, 1e7, *self._freshness(frame))
        return None

    def _number(
        self, what: Said, value: float, most: float, quality: Quality = "good", reason: str = ""
    ) -> Statement | None:
        if not abs(value) <= most:  # not a number, too
            self._bad["field"] += 1
            return None
        return Statement(what, value, quality, reason)

    def _freshness(self, frame: _Frame) -> tuple[Quality, str]:
        """Compare the autopilot's own time with that of its message before."""
        boot_ms = int.from_bytes(frame.payload[:4], "little")
        stands = self._boot_ms.get(frame.name) == boot_ms
        self._boot_ms[frame.name] = boot_ms
        return ("suspect", "stale: the autopilot's clock stands still") if stands else ("good", "")
