"""Seanet V4LOG (header version V1): messages of a sonar without their framing, each with the time of the PC.

A record is a size (u16, itself included), a time (f64, days since 1899-12-30, local), source and destination node,
then the message from its id on.  The head's answers to the start (version, settings) stand behind the pings although
they came before them; here everything comes in the order of its time.  Layout found out from a recording of 2005.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from config.errors import DataError
from drivers.records import Direction
from drivers.tritech.ids import HOST, MessageId
from tools.importers.capture import Captured, Format, Losses, pieces

LINE: Final = "sonar"
MAGIC: Final = b"SeaNetV4 Log File V1"
_HEADER: Final = struct.Struct("<8I")
_HEADER_AT: Final = 32
_RECORD: Final = struct.Struct("<HdBB")
_MESSAGE_HEAD: Final = 3
_FRAME_REST: Final = 5
_EPOCH_DAYS: Final = 25569
_DAY_NS: Final = 86_400_000_000_000
_LATEST_DAYS: Final = 100_000
_PIECE_BYTES: Final = 1 << 20


def read(path: Path, _baud: int, losses: Losses) -> Iterator[Captured]:
    """Yield each message as the serial frame that it was; raises DataError where the file's header is damaged."""
    data = b"".join(pieces(path, losses, lambda file: file.read1(_PIECE_BYTES)))
    if len(data) < _HEADER_AT + _HEADER.size:
        raise DataError(f"{path} is a V4LOG that ends within its header; nothing was recorded in it")
    _, _, start, _, trailer, index, _, _ = _HEADER.unpack_from(data, _HEADER_AT)
    if not _HEADER_AT < start <= len(data):
        raise DataError(f"{path} is a V4LOG whose header is damaged (records at {start}); nothing can be read")
    # A log that was never closed has no index: its records go on to the end of the file.
    end = min(index, len(data)) if index > start else len(data)
    found = sorted(_records(data, start, end, losses), key=lambda each: each.t_ns)
    if trailer > len(data):
        losses.add(f"the file breaks off at {len(data)} bytes")
    for each in found:
        yield Captured(each.t_ns - found[0].t_ns, each.utc_ns, each.line, each.direction, each.data)


def _records(data: bytes, position: int, end: int, losses: Losses) -> Iterator[Captured]:
    while position < end:
        if position + _RECORD.size > end:
            losses.add(f"the last record, at {position}, breaks off")
            return
        size, days, source, destination = _RECORD.unpack_from(data, position)
        message = data[position + _RECORD.size : position + size]
        if position + size > end or len(message) < _MESSAGE_HEAD or not _EPOCH_DAYS <= days < _LATEST_DAYS:
            # Without a good size the next record cannot be found.
            losses.add(f"the record at {position} is damaged; what follows it is lost")
            return
        utc_ns = round((days - _EPOCH_DAYS) * _DAY_NS)
        direction: Direction = "tx" if source == HOST else "rx"
        yield Captured(utc_ns, utc_ns, LINE, direction, frame(source, destination, message))
        position += size


def frame(source: int, destination: int, message: bytes) -> bytes:
    """Return the serial frame of ``message`` (id, sequence, node, payload), as it was on the line."""
    length = len(message) + _FRAME_REST
    count = 0 if message[0] == MessageId.HEAD_DATA else len(message) & 0xFF
    return b"@%04X" % length + length.to_bytes(2, "little") + bytes((source, destination, count)) + message + b"\n"


FORMAT: Final = Format(
    title="Seanet V4LOG",
    clock="times are the recording PC's local clock, taken as UTC",
    sniff=lambda head: head.startswith(MAGIC),
    read=read,
)
