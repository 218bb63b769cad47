"""The channels of a log: which record goes to which topic, and how its message looks.

``log_time`` is UTC and ``publish_time`` the monotonic stamp, both in nanoseconds, so a log opens in Foxglove on the
time of day.  The JSON of ``/clock`` and ``/event`` repeats its times for people; the message's own times are what is
read back, since a JSON number beyond 2**53 loses digits in other programs.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from functools import lru_cache
from typing import Final

from mcap.records import Schema

from config.errors import LogError
from drivers.records import Chunk, ClockPair, Direction, Event, Json, Record

RECORD_LIMIT: Final = 1 << 20
"""Largest payload of one message in bytes; a port never delivers as much at once."""

CLOCK_TOPIC: Final = "/clock"
EVENT_TOPIC: Final = "/event"
RAW_ENCODING: Final = "application/octet-stream"
JSON_ENCODING: Final = "json"

_RAW: Final = re.compile(r"/raw/([a-z0-9_-]+)/(rx|tx)")
_DIRECTIONS: Final[dict[str, Direction]] = {"rx": "rx", "tx": "tx"}
_INTEGER: Final = {"type": "integer"}
_U64: Final = 1 << 64

Maker = Callable[[int, int, bytes], Record]
"""Makes a record from UTC, monotonic time and payload."""


def _schema(number: int, name: str, properties: dict[str, Json]) -> Schema:
    text = json.dumps({"type": "object", "title": name, "properties": properties})
    return Schema(id=number, name=name, encoding="jsonschema", data=text.encode())


SCHEMAS: Final = {
    CLOCK_TOPIC: _schema(1, "lacuna.Clock", {"t_ns": dict(_INTEGER), "utc_ns": dict(_INTEGER)}),
    EVENT_TOPIC: _schema(
        2,
        "lacuna.Event",
        {"t_ns": dict(_INTEGER), "kind": {"type": "string"}, "fields": {"type": "object"}},
    ),
}
"""Schema of each topic that has one."""


def topic_of(record: Record) -> str:
    """Return the topic of ``record``; raise LogError where its port's name cannot be part of one."""
    if isinstance(record, ClockPair):
        return CLOCK_TOPIC
    if isinstance(record, Event):
        return EVENT_TOPIC
    return _raw_topic(record.port, record.direction)


@lru_cache(maxsize=256)
def _raw_topic(port: str, direction: Direction) -> str:
    topic = f"/raw/{port}/{direction}"
    if _RAW.fullmatch(topic) is None:
        raise LogError(f"cannot record port {port!r}: names are of a-z, 0-9, _ and -; rename the port")
    return topic


def payload_of(record: Record) -> bytes:
    """Return the message's bytes; raise LogError where the record cannot stand in a log."""
    if not (0 <= record.t_ns < _U64 and 0 <= record.utc_ns < _U64):
        raise LogError(
            f"cannot record a time outside 0 to 2**64 ns (t {record.t_ns}, UTC {record.utc_ns}); set the clock"
        )
    data = _payload(record)
    if len(data) > RECORD_LIMIT:
        raise LogError(f"cannot record {len(data)} bytes at once; split them to at most {RECORD_LIMIT}")
    return data


def _payload(record: Record) -> bytes:
    if isinstance(record, Chunk):
        return record.data
    if isinstance(record, ClockPair):
        return json.dumps({"t_ns": record.t_ns, "utc_ns": record.utc_ns}).encode()
    try:
        body = {"t_ns": record.t_ns, "kind": record.kind, "fields": record.fields}
        return json.dumps(body, allow_nan=False).encode()
    except (TypeError, ValueError) as error:
        raise LogError(f"cannot record event {record.kind!r}: {error}; give finite numbers, text and lists") from error


def maker_of(topic: str) -> Maker | None:
    """Return what turns the messages of ``topic`` into records; None for a topic not of the log's own (an export's).

    A maker raises ValueError, KeyError or TypeError on a payload that does not fit its topic.
    """
    if (raw := _RAW.fullmatch(topic)) is not None:
        port, direction = raw[1], _DIRECTIONS[raw[2]]
        return lambda utc_ns, t_ns, data: Chunk(t_ns, utc_ns, port, direction, data)
    return {CLOCK_TOPIC: _clock_pair, EVENT_TOPIC: _event}.get(topic)


def _clock_pair(utc_ns: int, t_ns: int, _data: bytes) -> Record:
    return ClockPair(t_ns, utc_ns)


def _event(utc_ns: int, t_ns: int, data: bytes) -> Record:
    body = json.loads(data)
    kind, fields = body["kind"], body["fields"]
    if not isinstance(kind, str) or not isinstance(fields, dict):
        raise TypeError("an event is a kind and its fields")
    return Event(t_ns, utc_ns, kind, fields)
