"""Depth or pressure in a column of delimited text: Valeport sensors, loggers, boards of one's own making.

Numbers stand between commas, semicolons, blanks or tabs, one line a measurement.  Nothing proves that a line is
whole, so what comes before the first end of line, or before the first one after an interruption, is not read.
"""

from __future__ import annotations

import re
from collections import Counter
from typing import Final

from config.schema import Feed
from drivers.counters import Counters
from drivers.keller import keller_reader
from drivers.statements import Meaning, Message, Reader, Statement
from drivers.wire import Arrivals, byte_ns

_LONGEST: Final = 256
_END: Final = re.compile(rb"[\r\n]")
BETWEEN: Final = re.compile(r"[,;\s]+")
NUMBER: Final = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)")
MBAR: Final = {
    "mbar": 1.0,
    "hpa": 1.0,
    "bar": 1000.0,
    "dbar": 100.0,
    "kpa": 10.0,
    "pa": 0.01,
    "psi": 68.947573,
}
METRES: Final = {"m": 1.0, "ft": 0.3048}


def pressure_reader(feed: Feed) -> Reader:
    """Return the reader of the feed's format."""
    return keller_reader(feed) if feed.format == "keller" else TextReader(feed)


class TextReader:
    """One message a line, from the configured column in the configured unit."""

    def __init__(self, feed: Feed) -> None:
        self._column = feed.column
        self._unit = feed.unit
        self._arrivals = Arrivals(byte_ns(feed))
        self._line: bytearray | None = None
        self._read = 0
        self._t_ns = 0
        self._skipped = 0
        self._frames: Counter[str] = Counter()
        self._bad: Counter[str] = Counter()

    @property
    def counters(self) -> Counters:
        """What was seen so far: ``line``; ``field`` are lines without a number where one is expected."""
        return Counters(dict(self._frames), self._skipped, dict(self._bad))

    def push(self, t_ns: int, data: bytes) -> list[Message]:
        """Take bytes that arrived at ``t_ns`` and return the messages that they complete."""
        messages: list[Message] = []
        at = 0
        self._arrivals.note(t_ns, len(data))
        for end in _END.finditer(data):
            self._hold(data[at : end.start()], at)
            messages += self._close()
            at = end.end()
        self._hold(data[at:], at)
        self._read += len(data)
        self._arrivals.drop(self._read)
        return messages

    def finish(self) -> list[Message]:
        """End the stream, or note that it was interrupted: a line without its end is not read."""
        self._skipped += len(self._line or b"")
        self._line = None
        return []

    def _hold(self, piece: bytes, at: int) -> None:
        if self._line is None:
            self._skipped += len(piece)
            return
        if piece and not self._line:
            self._t_ns = self._arrivals.at(self._read + at)
        self._line += piece
        if len(self._line) > _LONGEST:
            self._bad["too_long"] += 1
            self.finish()

    def _close(self) -> list[Message]:
        line, self._line = self._line, bytearray()
        if not line:
            return []
        words = BETWEEN.split(line.decode("ascii", "replace").strip())
        word = words[self._column - 1] if self._column <= len(words) else ""
        if not NUMBER.fullmatch(word):
            self._bad["field"] += 1
            return []
        self._frames["line"] += 1
        return [Message(self._t_ns, "line", (self._statement(float(word)),))]

    def _statement(self, value: float) -> Statement:
        if self._unit in METRES:
            return Statement(Meaning.DEPTH, value * METRES[self._unit])
        return Statement(Meaning.PRESSURE, value * MBAR[self._unit])
