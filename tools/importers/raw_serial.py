"""Raw serial captures: the bytes of one line and nothing else, so the times are made up from the line's rate."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Final

from tools.importers.capture import Captured, Format, Losses, pieces

LINE: Final = "serial"
_PIECES_PER_S: Final = 50
_BITS_PER_BYTE: Final = 10


def read(path: Path, baud: int, losses: Losses) -> Iterator[Captured]:
    """Yield 20 ms of a line that is always busy at a time, stamped with the end of their last byte."""
    size = max(1, baud // (_PIECES_PER_S * _BITS_PER_BYTE))
    count = 0
    for data in pieces(path, losses, lambda file: file.read(size)):
        count += len(data)
        yield Captured(count * _BITS_PER_BYTE * 1_000_000_000 // baud, None, LINE, "rx", data)


FORMAT: Final = Format(
    title="raw serial capture",
    clock="times are made from the number of bytes at the line's baud, as if the line had never been idle",
    sniff=lambda _head: True,
    read=read,
)
