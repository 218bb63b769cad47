"""Captures of a UDP or TCP hub: ``YYYY.MM.DD HH.MM.SS.mmm;address;port;HEX HEX ...``, a packet a line.

The hub's ports are the lines; packets cut frames anywhere and belong together in their order.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path
from typing import Final

from tools.importers.capture import Captured, Format, Losses, text_lines

_LINE: Final = re.compile(
    rb"(?P<time>\d{4}\.\d\d\.\d\d \d\d\.\d\d\.\d\d)\.(?P<ms>\d{3});"
    rb"(?P<host>[^;]*);(?P<port>\d{1,5});(?P<hex>[0-9A-Fa-f ]*)"
)


def read(path: Path, _baud: int, losses: Losses) -> Iterator[Captured]:
    """Yield a piece for each packet, stamped with the hub's wall clock, counted from the first packet."""
    start_ns: int | None = None
    for number, line in text_lines(path, losses):
        match = _LINE.fullmatch(line.strip())
        utc_ns = _utc_ns(match) if match is not None else None
        if match is None or utc_ns is None:
            losses.add(f"line {number} is not a packet")
            continue
        try:
            data = bytes.fromhex(match["hex"].decode("ascii"))
        except ValueError:
            losses.add(f"line {number} has an odd number of hex digits")
            continue
        start_ns = utc_ns if start_ns is None else start_ns
        yield Captured(utc_ns - start_ns, utc_ns, match["port"].decode("ascii"), "rx", data)


def _utc_ns(match: re.Match[bytes]) -> int | None:
    try:
        time = datetime.strptime(match["time"].decode("ascii"), "%Y.%m.%d %H.%M.%S").replace(tzinfo=UTC)
    except ValueError:
        return None
    return int(time.timestamp()) * 1_000_000_000 + int(match["ms"]) * 1_000_000


def _sniff(head: bytes) -> bool:
    return _LINE.match(head.lstrip()) is not None


FORMAT: Final = Format(
    title="hub CSV",
    clock="times are the hub's wall clock, taken as UTC",
    sniff=_sniff,
    read=read,
)
