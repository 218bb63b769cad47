"""Finding what is whole in the bytes of a log, however broken the rest is.

Bytes in, verified blocks out: the same blocks for any cutting of the bytes into pieces.  A chunk counts only when its
CRC and sizes are right, a header only when its own CRC is; nothing else in the file is believed, not even a length.
The next block is found by the shape of its first bytes, so one bad sector costs the chunk it lies in and no more.
"""

from __future__ import annotations

import io
import re
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final, NamedTuple

import zstandard
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Channel, Metadata

from drivers.log.header import is_intact
from drivers.log.layout import RECORD_LIMIT, Maker, maker_of
from drivers.log.segment import MAGIC, packed
from drivers.records import Record

BLOCK_LIMIT: Final = RECORD_LIMIT + (64 << 10)
"""Largest chunk or header that is looked at, in bytes, packed and unpacked: bounds the memory of a reader."""

# A chunk: opcode, length, two times, size, CRC, then "zstd"; a header: opcode, length, "lacuna".
_CANDIDATE: Final = re.compile(rb"\x06.{36}\x04\x00\x00\x00zstd|\x0c.{8}\x06\x00\x00\x00lacuna", re.DOTALL)
_REACH: Final = 45
_CHUNK_HEAD: Final = struct.Struct("<BQQQQI4x4xQ")
_RECORD_HEAD: Final = struct.Struct("<BQ")
_MESSAGE: Final = struct.Struct("<BQHIQQ")
_OPCODES: Final = frozenset(int(opcode) for opcode in Opcode)


@dataclass(slots=True)
class Damage:
    """What could not be read, counted over one or more files."""

    chunks_skipped: int = 0
    """Chunks and headers whose checksum or shape is wrong, the unfinished one at a broken end included."""

    bytes_skipped: int = 0
    """Bytes that belong to nothing readable."""

    truncated: int = 0
    """Files without a proper end: interrupted, cut off, or still being written."""

    records_missing: int = 0
    """Records that the sequence numbers of their channels show to have been there."""

    files_unreadable: int = 0
    """Files in which nothing at all could be read."""

    @property
    def is_any(self) -> bool:
        """Say whether anything was lost; an unfinished file alone is no loss."""
        return bool(self.chunks_skipped or self.bytes_skipped or self.records_missing or self.files_unreadable)


class Entry(NamedTuple):
    """A record with its channel's topic and its number in that channel."""

    topic: str
    sequence: int
    record: Record


Block = dict[str, str] | list[Entry]
"""A header's metadata, or the records of a chunk."""


class Scanner:
    """Takes the bytes of one log file in pieces, gives its verified blocks, and counts what was lost into ``damage``.

    Holds at most one block and one piece in memory.
    """

    def __init__(self, damage: Damage) -> None:
        self._damage = damage
        self._tiles = _Tiles()
        self._buffer = b""
        self._base = 0
        self._search = 0
        self._failed = 0

    def push(self, data: bytes) -> Iterator[Block]:
        """Take the next bytes of the file and yield the blocks that are whole by now."""
        self._buffer += data
        while (block := self._next(final=False)) is not None:
            yield block

    def finish(self) -> Iterator[Block]:
        """Say that the file has no more bytes: yield what is left, and count what is not."""
        while (block := self._next(final=True)) is not None:
            yield block
        end = self._base + len(self._buffer)
        self._tiles.walk(self._buffer, self._base, end)
        if not self._tiles.is_closed(end):
            self._damage.truncated += 1
            self._count(end)

    def _next(self, *, final: bool) -> Block | None:
        while True:
            match = _CANDIDATE.search(self._buffer, self._search)
            if match is None:
                self._search = max(self._search, len(self._buffer) - _REACH + 1)
                self._trim()
                return None
            start = match.start()
            end = start + 9 + int.from_bytes(self._buffer[start + 1 : start + 9], "little")
            if not final and len(self._buffer) < end <= start + BLOCK_LIMIT:
                self._search = start
                self._trim()
                return None
            block = _block(self._buffer[start:end]) if end <= min(len(self._buffer), start + BLOCK_LIMIT) else None
            if block is not None:
                self._pass(start, end)
                return block
            self._failed += 1
            self._search = start + 1

    def _pass(self, start: int, end: int) -> None:
        self._tiles.walk(self._buffer, self._base, self._base + start)
        self._count(self._base + start)
        self._tiles.restart(self._base + end)
        self._search = end

    def _count(self, upto: int) -> None:
        lost_from = self._tiles.lost_from(upto)
        if lost_from is not None:
            self._damage.bytes_skipped += upto - lost_from
            self._failed = max(self._failed, int(self._tiles.is_broken_at_chunk))
        self._damage.chunks_skipped += self._failed
        self._failed = 0

    def _trim(self) -> None:
        self._tiles.walk(self._buffer, self._base, self._base + self._search)
        self._buffer = self._buffer[self._search :]
        self._base += self._search
        self._search = 0


class _Tiles:
    """Follows the records between blocks from head to head, only to tell understood bytes from lost ones."""

    def __init__(self) -> None:
        self._next = 0
        self._last = 0
        self._broken: int | None = None
        self._footer = False
        self.is_broken_at_chunk = False

    def restart(self, position: int) -> None:
        self._next = self._last = position
        self._broken, self._footer, self.is_broken_at_chunk = None, False, False

    def walk(self, buffer: bytes, base: int, upto: int) -> None:
        """Go on to ``upto``; positions are those in the file, ``buffer`` begins at ``base``."""
        while self._broken is None and self._next < upto:
            length = self._length(buffer[self._next - base : self._next - base + 9])
            if length is None:
                self._broken = self._next
            else:
                self._last, self._next = self._next, self._next + length

    def lost_from(self, upto: int) -> int | None:
        """Return where the understood bytes before ``upto`` end, or None when they reach it."""
        if self._broken is not None:
            return min(self._broken, upto)
        return None if self._next == upto else self._last

    def is_closed(self, end: int) -> bool:
        """Say whether a footer and the closing magic stand right before ``end``."""
        return self._footer and self._broken is None and self._next == end

    def _length(self, head: bytes) -> int | None:
        if (self._next == 0 or self._footer) and head.startswith(MAGIC):
            return len(MAGIC)
        if len(head) < _RECORD_HEAD.size or self._next == 0:
            return None
        opcode, length = _RECORD_HEAD.unpack(head)
        self.is_broken_at_chunk = opcode == Opcode.CHUNK
        if opcode not in _OPCODES or self.is_broken_at_chunk or length > BLOCK_LIMIT * 16:
            return None
        self._footer = opcode == Opcode.FOOTER
        return int(length) + _RECORD_HEAD.size


def _block(data: bytes) -> Block | None:
    """Return what ``data``, one record of the file, holds, or None where anything about it is not right."""
    try:
        return _entries(data) if data[0] == Opcode.CHUNK else _metadata(data)
    except Exception:  # noqa: BLE001 - mcap, zstd and struct fail in ten ways on bad bytes; to a reader all mean "bad"
        return None


def _metadata(data: bytes) -> dict[str, str] | None:
    record = Metadata.read(_stream(data))
    # Written again, it must be the same bytes: a damaged length would otherwise reach over the chunks behind it.
    return record.metadata if packed([record]) == data and is_intact(record.metadata) else None


def _entries(data: bytes) -> list[Entry] | None:
    size, crc, packed_size = _CHUNK_HEAD.unpack_from(data)[4:]
    body = data[_CHUNK_HEAD.size :]
    if packed_size != len(body) or size > BLOCK_LIMIT:
        return None
    # Asked before unpacking: a damaged size would make zstd reserve gigabytes.
    if zstandard.get_frame_parameters(body).content_size != size:
        return None
    plain = zstandard.ZstdDecompressor().decompress(body)
    if len(plain) != size or zlib.crc32(plain) != crc:
        return None
    return list(_messages(plain))


def _messages(plain: bytes) -> Iterator[Entry]:
    channels: dict[int, tuple[str, Maker | None]] = {}
    position = 0
    while position < len(plain):
        opcode, length = _RECORD_HEAD.unpack_from(plain, position)
        start, position = position, position + _RECORD_HEAD.size + length
        if position > len(plain):
            raise ValueError("a record reaches beyond its chunk")
        if opcode == Opcode.MESSAGE:
            _, _, number, sequence, utc_ns, t_ns = _MESSAGE.unpack_from(plain, start)
            topic, make = channels[number]
            if make is not None:
                yield Entry(topic, sequence, make(utc_ns, t_ns, plain[start + _MESSAGE.size : position]))
        elif opcode == Opcode.CHANNEL:
            channel = Channel.read(_stream(plain[start:position]))
            channels[channel.id] = channel.topic, maker_of(channel.topic)


def _stream(data: bytes) -> ReadDataStream:
    return ReadDataStream(io.BytesIO(data[_RECORD_HEAD.size :]))
