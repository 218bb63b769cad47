"""Making whole files of segments that a crash left as ``.part``: the readable rest, with a summary, under its name.

``<session>-0002.mcap`` appears beside ``<session>-0002.mcap.part``, which stays as it is.  Readers of a folder take a
whole file before a ``.part`` of its number, and records keep their sequence numbers, so that the folder reads as it
did before: the same records, and the same gaps.
"""

from __future__ import annotations

import contextlib
import fcntl
import json
import os
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Final

from mcap.records import Message

from config.errors import DataError, LogError
from drivers.log.header import check_format, signed
from drivers.log.names import session_of
from drivers.log.reader import blocks, read_metadata
from drivers.log.scanner import Damage, Entry
from drivers.log.segment import PART, ChannelTable, ChunkBuffer, Segment, sync_folder
from drivers.log.writer import refused

_WORKSHOP: Final = ".salvage"


@dataclass(frozen=True, slots=True)
class Salvaged:
    """A segment made whole: its new file, how many records it holds, and what of the old one was lost."""

    path: Path
    records: int
    damage: Damage


def unfinished(folder: Path, session: str) -> list[Path]:
    """Return the ``.part`` files in ``folder`` that nobody writes or has made whole; none of ``session``."""
    parts = sorted(folder.glob(f"*.mcap{PART}"))
    return [part for part in parts if session_of(part) != session and not _whole(part).exists() and not _is_held(part)]


def make_whole(part: Path) -> Salvaged:
    """Write the readable records of ``part`` into a sound file under the final name; ``part`` stays as it is.

    Raises DataError where the header or everything else is unreadable, LogError where the disk refuses.
    """
    metadata = read_metadata(part)
    check_format(metadata, part.name)
    damage = Damage()
    records = sum(1 for _ in _entries(part, damage))
    if records == 0:
        raise DataError(f"{part.name} holds no records; there is nothing to save")
    lost = {name: count for name, count in asdict(damage).items() if name != "truncated"}
    header = signed(metadata | {"salvaged_from": part.name, "lost": json.dumps(lost)})
    workshop = part.parent / _WORKSHOP
    try:
        _clear(workshop)
        workshop.mkdir()
        made = workshop / _whole(part).name
        _write(made, header, _entries(part, Damage()))
        if _whole(part).exists():
            raise FileExistsError(f"{_whole(part)} exists")
        made.rename(_whole(part))
        sync_folder(part.parent)
        _clear(workshop)
    except OSError as error:
        with contextlib.suppress(OSError):
            _clear(workshop)
        raise refused(error, part.parent) from error
    return Salvaged(_whole(part), records, damage)


def lost_in_words(damage: Damage) -> str:
    """Return what was lost, for people."""
    if not damage.is_any:
        return "nothing"
    words = [f"{damage.chunks_skipped} chunks", f"{damage.bytes_skipped} bytes that belong to nothing readable"]
    if damage.records_missing:
        words.append(f"{damage.records_missing} records by their numbers")
    if damage.files_unreadable:
        words.append(f"{damage.files_unreadable} files in which nothing could be read")
    return ", ".join(words)


def _write(path: Path, metadata: dict[str, str], entries: Iterator[Entry]) -> None:
    table, buffer = ChannelTable(), ChunkBuffer()
    segment = Segment(path, metadata)
    try:
        for _, sequence, record in entries:
            channel, numbered = table.message(record)
            message = Message(channel.id, numbered.log_time, numbered.data, numbered.publish_time, sequence)
            if not buffer.has_room(message):
                segment.write_chunk(buffer)
                buffer.clear()
            buffer.add(channel, message)
        segment.write_chunk(buffer)
        segment.close()
    except BaseException:
        segment.discard()
        raise


def _entries(part: Path, damage: Damage) -> Iterator[Entry]:
    for block in blocks(part, damage):
        if not isinstance(block, dict):
            yield from block


def _whole(part: Path) -> Path:
    return part.with_name(part.name.removesuffix(PART))


def _clear(workshop: Path) -> None:
    """Remove what an interrupted attempt has left; the folder holds nothing else."""
    if workshop.is_dir():
        for each in workshop.iterdir():
            each.unlink()
        workshop.rmdir()


def _is_held(part: Path) -> bool:
    """Tell whether a program is writing ``part``: it holds a lock on it for as long as it lives."""
    try:
        descriptor = os.open(part, os.O_RDONLY)
    except OSError as error:
        raise LogError(f"cannot open {part}: {error.strerror}; check its permissions") from error
    try:
        fcntl.flock(descriptor, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    except OSError:
        return False  # a file system without locks
    else:
        return False
    finally:
        os.close(descriptor)
