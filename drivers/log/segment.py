"""One MCAP file: chunks that stand alone, and the summary that makes it quick to open.

Why not ``mcap.writer.Writer``: it puts the definition of a channel into the first chunk only, so one bad sector there
makes all later chunks unreadable in a file that was never closed; and once a write has failed halfway it cannot tell
what reached the disk.  Here mcap's own record classes are written instead: every chunk carries the channels and
schemas of its messages, and a chunk with its index goes out in one write.
"""

from __future__ import annotations

import contextlib
import errno
import fcntl
import os
import zlib
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any, Final

import zstandard
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Channel,
    Chunk,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    McapRecord,
    Message,
    MessageIndex,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)

from drivers.log.layout import JSON_ENCODING, RAW_ENCODING, SCHEMAS, payload_of, topic_of
from drivers.records import Record

MAGIC: Final = b"\x89MCAP0\r\n"
METADATA_NAME: Final = "lacuna"
CHUNK_BYTES: Final = 64 * 1024
"""Most uncompressed bytes of a chunk; only a single larger record makes a larger chunk."""

PART: Final = ".part"
_MESSAGE_HEAD: Final = 31
_ZSTD_LEVEL: Final = 1


def packed(records: Iterable[McapRecord]) -> bytes:
    """Return the bytes of ``records`` in their order."""
    builder: Any = RecordBuilder()
    for record in records:
        record.write(builder)
    return bytes(builder.end())


class ChannelTable:
    """Numbers channels in the order in which they appear, and the messages of each."""

    def __init__(self) -> None:
        self._channels: dict[str, Channel] = {}
        self._sequences: dict[str, int] = {}

    def message(self, record: Record) -> tuple[Channel, Message]:
        """Return the message of ``record`` and its channel; raise LogError where it cannot be recorded."""
        topic, data = topic_of(record), payload_of(record)
        channel = self._channels.get(topic)
        if channel is None:
            channel = self._channels[topic] = _channel(len(self._channels) + 1, topic)
        sequence = self._sequences.get(topic, 0)
        self._sequences[topic] = (sequence + 1) & 0xFFFFFFFF
        return channel, Message(channel.id, record.utc_ns, data, record.t_ns, sequence)


class ChunkBuffer:
    """Messages of the chunk in the making."""

    def __init__(self) -> None:
        self.channels: dict[int, Channel] = {}
        self.messages: list[Message] = []
        self.size = 0
        """Bytes of the messages, uncompressed."""

    def has_room(self, message: Message) -> bool:
        """Say whether ``message`` still fits; an empty chunk takes any."""
        return not self.messages or self.size + _MESSAGE_HEAD + len(message.data) <= CHUNK_BYTES

    def add(self, channel: Channel, message: Message) -> None:
        """Append ``message``."""
        self.channels[channel.id] = channel
        self.messages.append(message)
        self.size += _MESSAGE_HEAD + len(message.data)

    def clear(self) -> None:
        """Forget everything."""
        self.channels.clear()
        self.messages.clear()
        self.size = 0


class Segment:
    """An MCAP file being written as ``path`` + ``.part``, renamed to ``path`` when it is whole.

    Every method may raise OSError; the file is then left as it is, to be read as far as it goes.
    """

    def __init__(self, path: Path, metadata: Mapping[str, str]) -> None:
        if path.exists():
            raise FileExistsError(errno.EEXIST, "exists", str(path))
        self._path = path
        self._part = path.with_name(path.name + PART)
        self._file = self._part.open("xb", buffering=0)
        _hold(self._file.fileno())
        self._channels: dict[int, Channel] = {}
        self._counts: dict[int, int] = {}
        self._indexes: list[ChunkIndex] = []
        self._metadata: list[MetadataIndex] = []
        self._is_listed = False
        self.size = 0
        """Bytes written."""
        try:
            self._begin(metadata)
        except OSError:
            # A file without its header says nothing: no trace of it, so that a later try finds the name free.
            self._file.close()
            self._part.unlink()
            raise

    def _begin(self, metadata: Mapping[str, str]) -> None:
        self._put(MAGIC + packed([Header(profile="", library="lacuna")]))
        for _ in range(2):
            record = packed([Metadata(name=METADATA_NAME, metadata=dict(metadata))])
            self._metadata.append(MetadataIndex(offset=self.size, length=len(record), name=METADATA_NAME))
            self._put(record)

    def write_chunk(self, buffer: ChunkBuffer) -> None:
        """Write ``buffer`` as a chunk with its message index, in one write; ``buffer`` stays as it is."""
        if not buffer.messages:
            return
        chunk, index = _chunk(buffer)
        body = packed([chunk])
        index.chunk_start_offset, index.chunk_length = self.size, len(body)
        tail = b""
        for channel_id, entries in _message_indexes(buffer).items():
            index.message_index_offsets[channel_id] = self.size + len(body) + len(tail)
            tail += packed([MessageIndex(channel_id, entries)])
        index.message_index_length = len(tail)
        self._put(body + tail)
        self._indexes.append(index)
        self._channels |= buffer.channels
        for message in buffer.messages:
            self._counts[message.channel_id] = self._counts.get(message.channel_id, 0) + 1

    def syncing(self) -> Callable[[], None]:
        """Return what waits until all written so far is on the disk; it may run elsewhere, and after ``close``."""
        own = os.dup(self._file.fileno())
        is_listed, self._is_listed = self._is_listed, True

        def wait() -> None:
            try:
                os.fdatasync(own)
            finally:
                os.close(own)
            if not is_listed:
                sync_folder(self._path.parent)

        return wait

    def sync(self) -> None:
        """Wait until what was written is on the disk."""
        self.syncing()()

    def close(self) -> None:
        """Write the summary, and give the file its name once it is on the disk."""
        self.finish()
        self.seal()

    def finish(self) -> None:
        """Write the summary: nothing is written after it."""
        self._put(packed([DataEnd(0)]))
        self._put(self._summary())

    def seal(self) -> None:
        """Wait until the finished file is on the disk, then give it its name; the file is closed whatever happens."""
        try:
            os.fsync(self._file.fileno())
        finally:
            self._file.close()
        if self._path.exists():
            raise FileExistsError(errno.EEXIST, "exists", str(self._path))
        self._part.rename(self._path)
        sync_folder(self._path.parent)

    def abandon(self) -> None:
        """Close the file as it is, under its ``.part`` name."""
        self._file.close()

    def discard(self) -> None:
        """Close the file and remove it."""
        self._file.close()
        self._part.unlink(missing_ok=True)

    def _summary(self) -> bytes:
        groups: dict[Opcode, list[McapRecord]] = {
            Opcode.SCHEMA: list(_schemas(self._channels.values())),
            Opcode.CHANNEL: list(self._channels.values()),
            Opcode.STATISTICS: [self._statistics()],
            Opcode.CHUNK_INDEX: list(self._indexes),
            Opcode.METADATA_INDEX: list(self._metadata),
        }
        body, offsets = b"", []
        for opcode, records in groups.items():
            group = packed(records)
            if group:
                offsets.append(SummaryOffset(opcode, self.size + len(body), len(group)))
            body += group
        footer = Footer(summary_start=self.size, summary_offset_start=self.size + len(body), summary_crc=0)
        body += packed(offsets)
        # The specification's CRC covers the summary and the footer up to the CRC itself.
        footer.summary_crc = zlib.crc32(packed([footer])[:-4], zlib.crc32(body))
        return body + packed([footer]) + MAGIC

    def _statistics(self) -> Statistics:
        return Statistics(
            attachment_count=0,
            channel_count=len(self._channels),
            channel_message_counts=dict(self._counts),
            chunk_count=len(self._indexes),
            message_count=sum(self._counts.values()),
            message_end_time=max((index.message_end_time for index in self._indexes), default=0),
            message_start_time=min((index.message_start_time for index in self._indexes), default=0),
            metadata_count=len(self._metadata),
            schema_count=len(_schemas(self._channels.values())),
        )

    def _put(self, data: bytes) -> None:
        rest = memoryview(data)
        while rest:
            # A nearly full disk takes a part and says so only by the count.
            rest = rest[self._file.write(rest) :]
        self.size += len(data)


def _hold(descriptor: int) -> None:
    """Show others that the file is being written: the lock ends with the process, however it ends."""
    with contextlib.suppress(OSError):  # a file system without locks
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)


def sync_folder(folder: Path) -> None:
    """Wait until the names in ``folder`` are on the disk, where its file system can say so."""
    number = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(number)
    except OSError as error:
        # FAT on some kernels and FUSE mounts cannot sync a folder; the file itself is safe.
        if error.errno not in (errno.EINVAL, errno.ENOTSUP):
            raise
    finally:
        os.close(number)


def _channel(number: int, topic: str) -> Channel:
    schema = SCHEMAS.get(topic)
    encoding = JSON_ENCODING if schema else RAW_ENCODING
    return Channel(number, topic, encoding, {}, schema.id if schema else 0)


def _schemas(channels: Iterable[Channel]) -> list[Schema]:
    return [SCHEMAS[channel.topic] for channel in channels if channel.schema_id]


def _chunk(buffer: ChunkBuffer) -> tuple[Chunk, ChunkIndex]:
    channels = buffer.channels.values()
    data = packed([*_schemas(channels), *channels, *buffer.messages])
    compressed = zstandard.ZstdCompressor(level=_ZSTD_LEVEL).compress(data)
    times = [message.log_time for message in buffer.messages]
    chunk = Chunk("zstd", compressed, max(times), min(times), zlib.crc32(data), len(data))
    index = ChunkIndex(0, 0, "zstd", len(compressed), max(times), 0, {}, min(times), len(data))
    return chunk, index


def _message_indexes(buffer: ChunkBuffer) -> dict[int, list[tuple[int, int]]]:
    channels = buffer.channels.values()
    offset = len(packed([*_schemas(channels), *channels]))
    entries: dict[int, list[tuple[int, int]]] = {}
    for message in buffer.messages:
        entries.setdefault(message.channel_id, []).append((message.log_time, offset))
        offset += _MESSAGE_HEAD + len(message.data)
    return entries
