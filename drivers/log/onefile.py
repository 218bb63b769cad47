"""Writing records into one log file: what imports and salvaged logs are."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path

from drivers.log.segment import ChannelTable, ChunkBuffer, Segment
from drivers.log.writer import refused
from drivers.records import Record


def write_log(path: Path, metadata: Mapping[str, str], records: Iterable[Record]) -> int:
    """Write ``records`` into the one file ``path``, which appears when it is whole; return their number.

    Raises LogError, also where ``path`` exists.  Whatever stops the writing, the unfinished file is removed.
    """
    table, buffer, count = ChannelTable(), ChunkBuffer(), 0
    try:
        segment = Segment(path, metadata)
    except OSError as error:
        raise refused(error, path) from error
    try:
        for record in records:
            channel, message = table.message(record)
            if not buffer.has_room(message):
                segment.write_chunk(buffer)
                buffer.clear()
            buffer.add(channel, message)
            count += 1
        segment.write_chunk(buffer)
        segment.close()
    except OSError as error:
        segment.discard()
        raise refused(error, path) from error
    except BaseException:
        segment.discard()
        raise
    return count
