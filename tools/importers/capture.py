"""What every importer gives: pieces of a recording, with their time and line, and a count of what it could not read."""

from __future__ import annotations

import gzip
import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from io import BufferedIOBase
from pathlib import Path
from typing import Final

from config.errors import InputError
from drivers.records import Direction

TEXT_LINE_LIMIT: Final = 4 << 20
"""Longest line of text that is looked at, in bytes; bounds the memory for a file that is not what it seems."""

_GZIP: Final = b"\x1f\x8b"


@dataclass(frozen=True, slots=True)
class Captured:
    """Bytes of one line of a foreign recording; ``utc_ns`` is None where the recording does not know the date."""

    t_ns: int
    utc_ns: int | None
    line: str
    direction: Direction
    data: bytes


@dataclass(slots=True)
class Losses:
    """What of the foreign file could not be read: ``first`` says where it began."""

    pieces: int = 0
    first: str = ""

    def add(self, where: str) -> None:
        """Count one piece."""
        self.pieces += 1
        self.first = self.first or where


Reader = Callable[[Path, int, Losses], Iterator[Captured]]
"""Reads a file at a line rate in baud; may be called again for a second pass."""


@dataclass(frozen=True, slots=True)
class Format:
    """A foreign format: ``sniff`` looks at a file's first 4 KiB, ``clock`` says where the times come from."""

    title: str
    clock: str
    sniff: Callable[[bytes], bool]
    read: Reader


def opened(path: Path) -> BufferedIOBase:
    """Open ``path`` for reading, unpacking gzip; raises InputError."""
    try:
        with path.open("rb") as file:
            is_packed = file.read(2) == _GZIP
        return gzip.GzipFile(path, "rb") if is_packed else path.open("rb")
    except OSError as error:
        raise InputError(f"cannot read {path}: {error.strerror}; check the name") from error


def pieces(path: Path, losses: Losses, read: Callable[[BufferedIOBase], bytes]) -> Iterator[bytes]:
    """Yield what ``read`` takes from the opened ``path`` until it is empty; a damaged gzip ends where it breaks."""
    with opened(path) as file:
        while True:
            try:
                piece = read(file)
            except (EOFError, zlib.error, OSError) as error:
                losses.add(f"the file breaks off ({error})")
                return
            if not piece:
                return
            yield piece


def text_lines(path: Path, losses: Losses) -> Iterator[tuple[int, bytes]]:
    """Yield the lines of ``path`` with their numbers from 1; one longer than TEXT_LINE_LIMIT is counted as lost."""
    is_inside = False
    for number, line in enumerate(pieces(path, losses, lambda file: file.readline(TEXT_LINE_LIMIT)), 1):
        is_cut = len(line) == TEXT_LINE_LIMIT and not line.endswith(b"\n")
        if is_cut or is_inside:
            losses.add(f"line {number} is too long")
        elif line.strip():
            yield number, line
        is_inside = is_cut
