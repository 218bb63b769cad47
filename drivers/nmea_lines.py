"""Sentences of NMEA 0183 and their kin, cut out of a stream of bytes, with their checksum."""

from __future__ import annotations

import re
from collections import Counter
from dataclasses import dataclass
from typing import Final, Literal

from drivers.wire import Arrivals

LONGEST: Final = 256
"""The standard's 82 characters are too few for real compasses; this only bounds what a broken line can hold."""

_MARK: Final = re.compile(rb"[$!\r\n]")
_SUM: Final = re.compile(rb"[0-9A-Fa-f]{2}")
_GARBLED: Final = re.compile(rb"[^\x20-\x7e]")

Verdict = Literal["right", "wrong", "absent"]


@dataclass(frozen=True, slots=True)
class Sentence:
    """What stands between ``$`` and ``*`` or the end of the line; ``t_ns`` is when its ``$`` arrived.

    ``encapsulated``: it began with ``!``, as those of other ships (AIS) do; its fields are no plain text.
    """

    t_ns: int
    body: bytes
    checksum: Verdict
    encapsulated: bool = False


class SentenceReader:
    """Cuts sentences out of a stream, in memory bounded by `LONGEST`; the same for any pieces.

    A sentence ends with its line.  One that runs into the next ``$`` or ``!``, or into the end of the stream, counts
    only if it carries a right checksum: nothing else tells whether it is whole.
    """

    def __init__(self, byte_ns: int = 0) -> None:
        self.skipped = 0
        self.bad: Counter[str] = Counter()
        self._line: bytearray | None = None
        self._arrivals = Arrivals(byte_ns)
        self._read = 0
        self._t_ns = 0
        self._encapsulated = False

    def push(self, t_ns: int, data: bytes) -> list[Sentence]:
        """Take bytes that arrived at ``t_ns`` and return the sentences that they complete."""
        sentences: list[Sentence] = []
        at = 0
        self._arrivals.note(t_ns, len(data))
        for mark in _MARK.finditer(data):
            self._hold(data[at : mark.start()])
            opening = mark.group() in b"$!"
            sentences += self._end(cut_short=opening)
            if opening:
                self._line, self._t_ns = bytearray(), self._arrivals.at(self._read + mark.start())
                self._encapsulated = mark.group() == b"!"
            at = mark.end()
        self._hold(data[at:])
        self._read += len(data)
        self._arrivals.drop(self._read)
        return sentences

    def finish(self) -> list[Sentence]:
        """End the stream."""
        return self._end(cut_short=True)

    def _hold(self, piece: bytes) -> None:
        if self._line is None:
            self.skipped += len(piece)
            return
        self._line += piece
        if len(self._line) > LONGEST:
            self.skipped += 1 + len(self._line)
            self.bad["too_long"] += 1
            self._line = None

    def _end(self, *, cut_short: bool) -> list[Sentence]:
        line, self._line = self._line, None
        if line is None:
            return []
        if _GARBLED.search(line):
            self.bad["garbled"] += 1
            self.skipped += 1 + len(line)
            return []
        sentence = _sentence(self._t_ns, bytes(line), self._encapsulated)
        if cut_short and sentence.checksum != "right":
            self.skipped += 1 + len(line)
            return []
        return [sentence]


def _sentence(t_ns: int, line: bytes, encapsulated: bool) -> Sentence:
    body, star, digits = line.rpartition(b"*")
    if not star:
        return Sentence(t_ns, line, "absent", encapsulated)
    digits = digits.strip()
    if not digits:
        return Sentence(t_ns, body, "absent", encapsulated)
    right = _SUM.fullmatch(digits) is not None and int(digits, 16) == xor(body)
    return Sentence(t_ns, body, "right" if right else "wrong", encapsulated)


def xor(body: bytes) -> int:
    """Checksum of the bytes between ``$`` and ``*``."""
    total = 0
    for byte in body:
        total ^= byte
    return total
