"""A line on the terminal that says how far long work is; nothing where there is no terminal."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterable, Iterator
from typing import Final, TypeVar

T = TypeVar("T")

_EVERY: Final = 1000
_LINE_S: Final = 0.2
_CLEAR: Final = "\r\x1b[K"


def counted(items: Iterable[T], what: str) -> Iterator[T]:
    """Yield ``items``, rewriting the line ``what: N`` on standard error a few times a second; clear it at the end."""
    if not sys.stderr.isatty():
        yield from items
        return
    # Short work stays silent: the first line comes after a while.
    told_s = time.monotonic()
    try:
        for number, item in enumerate(items):
            if number % _EVERY == 0 and time.monotonic() - told_s >= _LINE_S:
                told_s = time.monotonic()
                print(f"{_CLEAR}{what}: {number}", end="", file=sys.stderr, flush=True)
            yield item
    finally:
        print(_CLEAR, end="", file=sys.stderr, flush=True)
