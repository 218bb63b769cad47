"""Records: what stands in a log, in the order in which it happened."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

Direction = Literal["rx", "tx"]
Json = None | bool | int | float | str | list["Json"] | dict[str, "Json"]


@dataclass(frozen=True, slots=True)
class Chunk:
    """Bytes that came from a port (``rx``) or went to it (``tx``), as they came or went."""

    t_ns: int
    utc_ns: int
    port: str
    direction: Direction
    data: bytes


@dataclass(frozen=True, slots=True)
class Event:
    """Something that happened to the program or that a person said: ``kind`` and its fields.

    Kinds: ``started``, ``stopped``, ``port_opened``, ``port_lost``, ``settings``, ``mark``, ``hint``, ``drop``,
    ``note``, ``tare``, ``disk``.  The map may depend on an event only through the log.
    """

    t_ns: int
    utc_ns: int
    kind: str
    fields: dict[str, Json] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class ClockPair:
    """Monotonic and UTC time, read together."""

    t_ns: int
    utc_ns: int


Record = Chunk | Event | ClockPair
