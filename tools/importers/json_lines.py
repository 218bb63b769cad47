"""JSON lines ``{"t_ns": ..., "port": ..., "dir": "rx" or "tx", "hex": ...}``, plain or gzip."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from tools.importers.capture import Captured, Format, Losses, text_lines

_KEYS: Final = (b'"t_ns"', b'"port"', b'"hex"')


def read(path: Path, _baud: int, losses: Losses) -> Iterator[Captured]:
    """Yield a piece for each line; one that does not fit the format is counted as lost."""
    for number, line in text_lines(path, losses):
        try:
            yield _piece(json.loads(line))
        except (ValueError, KeyError, TypeError):
            losses.add(f"line {number} is not a piece of a capture")


def _piece(body: object) -> Captured:
    if not isinstance(body, dict):
        raise TypeError("a line is an object")
    t_ns, port, direction = body["t_ns"], body["port"], body.get("dir", "rx")
    if not isinstance(t_ns, int) or isinstance(t_ns, bool) or not isinstance(port, str):
        raise TypeError("t_ns is an integer, port a text")
    if direction not in ("rx", "tx"):
        raise ValueError("dir is rx or tx")
    return Captured(t_ns, None, port, direction, bytes.fromhex(body["hex"]))


def _sniff(head: bytes) -> bool:
    first = head.lstrip()[:4096]
    return first.startswith(b"{") and all(key in first for key in _KEYS)


FORMAT: Final = Format(
    title="JSON lines",
    clock="t_ns is the capture's own",
    sniff=_sniff,
    read=read,
)
