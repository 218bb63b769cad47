"""What the device on a feed's line says, before it is a reading: a number, what it means, how far to trust it."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import Protocol

from drivers.counters import Counters
from drivers.readings import Quality


class Meaning(Enum):
    """What a number means."""

    MAGNETIC = "magnetic heading, degrees"
    TRUE = "true heading, degrees"
    VARIATION = "magnetic variation, degrees, east positive"
    FIELD = "strength of the magnetic field, in the instrument's own unit"
    BELOW_SURFACE = "distance of a thing below the surface, metres: the vehicle's depth, if the feed is so configured"
    ABOVE_FLOOR = "distance down to a thing, metres: the vehicle's altitude, if the feed is so configured"
    DEPTH = "the vehicle's depth, metres"
    ALTITUDE = "the vehicle's altitude, metres"
    ABSOLUTE = "absolute pressure, mbar"
    GAUGE = "pressure above the one at the water's surface, mbar"
    PRESSURE = "pressure, mbar: absolute or gauge, as the feed is configured"


@dataclass(frozen=True, slots=True)
class Statement:
    """One number of a message, and the device's own opinion of it."""

    what: Meaning
    value: float
    quality: Quality = "good"
    reason: str = ""


@dataclass(frozen=True, slots=True)
class Moved:
    """How far the vehicle moved in the last ``dt_s``, in the instrument's own axes."""

    right_m: float
    ahead_m: float
    dt_s: float
    quality: Quality = "good"
    reason: str = ""


@dataclass(frozen=True, slots=True)
class Located:
    """Where the vehicle is, from an origin that nobody knows, at ``clock_s`` of the device's own clock."""

    east_m: float
    north_m: float
    clock_s: float
    quality: Quality = "good"
    reason: str = ""


AnyStatement = Statement | Moved | Located


@dataclass(frozen=True, slots=True)
class Message:
    """One whole message: ``t_ns`` is when its first byte came, ``name`` what counters and sources call it."""

    t_ns: int
    name: str
    statements: tuple[AnyStatement, ...] = ()


class Reader(Protocol):
    """Turns the bytes of one line into messages: pure, in bounded memory, and the same for any cutting of the stream.

    Where a cutting moves the time at which bytes arrived, dates follow within that move; nothing else changes.
    """

    @property
    def counters(self) -> Counters:
        """What was seen so far."""

    def push(self, t_ns: int, data: bytes) -> list[Message]:
        """Take bytes that arrived at ``t_ns`` and return the messages that they complete."""

    def finish(self) -> list[Message]:
        """End the stream, or note that it was interrupted: what is left of a message is counted as skipped."""
