"""Reading logs back, whole or broken: never wrong data, and as much of the right as there is."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import BinaryIO, Final

from config.errors import DataError, InputError, LogError
from drivers.log.header import LogHeader, check_format, header_of
from drivers.log.names import log_files
from drivers.log.scanner import Block, Damage, Entry, Scanner
from drivers.records import Record

PIECE: Final = 256 << 10
"""Bytes read at a time."""

_WRAP: Final = 1 << 32


class Sequences:
    """Counts the records that are missing between the numbers of those that are there."""

    def __init__(self, damage: Damage) -> None:
        self._damage = damage
        self._session: str | None = None
        self._next: dict[str, int] = {}
        self._is_complete = False

    def begin(self, metadata: dict[str, str]) -> None:
        """Take the header of the segment whose records follow."""
        if metadata.get("session") == self._session:
            return
        self._session = metadata.get("session")
        self._next.clear()
        # From its first segment on, a session's channels begin at 0; later ones begin anywhere.
        self._is_complete = metadata.get("segment") == "1"

    def take(self, entries: list[Entry]) -> None:
        """Take the records of the next chunk."""
        for topic, sequence, _ in entries:
            expected = self._next.get(topic, 0 if self._is_complete else sequence)
            # A step back is another session without a header, not four thousand million lost records.
            if sequence > expected:
                self._damage.records_missing += sequence - expected
            self._next[topic] = (sequence + 1) % _WRAP


def read_log(paths: Path | Sequence[Path], damage: Damage | None = None) -> Iterator[Record]:
    """Yield the records of ``paths`` in the order in which they were written.

    A folder stands for its segments, by session and number.  What is damaged is skipped and counted in ``damage``.
    Raises InputError for a path that is not there, DataError where no file holds anything readable or one was
    written by a newer version, LogError where the disk fails.
    """
    files = log_files([paths] if isinstance(paths, Path) else paths)
    return _records(files, damage if damage is not None else Damage())


def _records(files: list[Path], damage: Damage) -> Iterator[Record]:
    sequences = Sequences(damage)
    is_readable = False
    for path in files:
        is_file_readable = False
        for block in blocks(path, damage):
            is_file_readable = True
            if isinstance(block, dict):
                check_format(block, path.name)
                sequences.begin(block)
            else:
                sequences.take(block)
                for entry in block:
                    yield entry.record
        damage.files_unreadable += not is_file_readable
        is_readable |= is_file_readable
    if not is_readable:
        raise nothing_in(files[0])


def read_header(path: Path) -> LogHeader:
    """Return the header of the log ``path``; of a folder, the first that can be read.

    Raises InputError for a path that is not there, DataError where there is no readable header, where a newer version
    wrote it, or where its configuration does not validate any more.
    """
    return header_of(read_metadata(path), path.name)


def read_metadata(path: Path) -> dict[str, str]:
    """Return the header of ``path`` as it stands in the file; errors as for ``read_header``, but for its content."""
    files = log_files([path])
    has_records = False
    for each in files:
        for block in blocks(each, Damage()):
            if isinstance(block, dict):
                return block
            has_records = True
            break  # the header stands before all chunks
    if has_records:
        raise DataError(f"{path.name}: its header is damaged, its records are not; give a configuration with --config")
    raise nothing_in(files[0])


def blocks(path: Path, damage: Damage) -> Iterator[Block]:
    """Yield the verified blocks of one file; raise InputError or LogError where it cannot be opened or read."""
    scanner = Scanner(damage)
    try:
        file = path.open("rb", buffering=0)
    except OSError as error:
        raise InputError(f"cannot open {path}: {error.strerror}; check the path and its permissions") from error
    with file:
        read = reading(file, path)
        while data := read():
            yield from scanner.push(data)
    yield from scanner.finish()


def reading(file: BinaryIO, path: Path) -> Callable[[], bytes]:
    """Return a function that reads the next piece of ``file``, and raises LogError where the disk fails."""

    def read() -> bytes:
        try:
            return file.read(PIECE)
        except OSError as error:
            raise LogError(f"cannot read {path}: {error.strerror}; copy it to another disk and try again") from error

    return read


def nothing_in(path: Path) -> DataError:
    """Return the error that says why ``path`` has nothing to read."""
    if path.stat().st_size == 0:
        return DataError(f"{path} is empty; nothing was recorded in it")
    return DataError(
        f"{path} is not a log of lacuna, or nothing in it is readable; a foreign file needs 'lacuna import'"
    )
