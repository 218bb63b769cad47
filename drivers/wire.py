"""When each byte of a line came, and frames cut out of a stream of bytes.

A chunk is stamped when it was read, and may hold bytes that came long before: at 4800 baud a sentence of 40
characters is 83 ms old when its last byte arrives, 2.4 degrees of a turn of half a radian a second.  The last byte
of a chunk came at its stamp at the latest; the one before it the time of a byte earlier, and so on; none came before
the stamp of the chunk that was read before, for it was not in that one.  On a line that is never idle this dates each
byte alike, whether it was read alone or among others.  Where there is no line to reckon with (a network), bytes are
dated by their chunk.
"""

from __future__ import annotations

import re
from bisect import bisect_right
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from config.schema import Feed

_BITS: Final = 10
_NS: Final = 1_000_000_000
MORE: Final = 0
"""A judge's answer: what is there may become a frame."""


def byte_ns(feed: Feed) -> int:
    """Time of one byte on the feed's line: start bit, eight bits, stop bit; 0 for anything but a device."""
    return _BITS * _NS // feed.baud if feed.port.startswith("/") else 0


class Arrivals:
    """Dates the bytes of a stream by their offset from its beginning; forgets what is dropped."""

    def __init__(self, byte_ns: int) -> None:
        self._byte_ns = byte_ns
        self._ends: list[int] = []
        self._stamps: list[tuple[int, int]] = []
        self._end = 0
        self._newest_ns: int | None = None

    def note(self, t_ns: int, size: int) -> None:
        """Note that ``size`` more bytes were read at ``t_ns``."""
        before_ns = t_ns - size * self._byte_ns if self._newest_ns is None else min(self._newest_ns, t_ns)
        self._newest_ns = t_ns
        self._end += size
        self._ends.append(self._end)
        self._stamps.append((before_ns, t_ns))

    def at(self, offset: int) -> int:
        """Return when the first bit of the byte at ``offset`` came."""
        index = min(bisect_right(self._ends, offset), len(self._ends) - 1)
        before_ns, t_ns = self._stamps[index]
        return max(before_ns, t_ns - (self._ends[index] - offset) * self._byte_ns)

    def drop(self, offset: int) -> None:
        """Forget bytes before ``offset``; the newest chunk is kept."""
        gone = min(bisect_right(self._ends, offset), len(self._ends) - 1)
        if gone > 0:
            del self._ends[:gone], self._stamps[:gone]


@dataclass(frozen=True, slots=True)
class Cut:
    """One whole frame; ``t_ns`` is when its first byte came."""

    t_ns: int
    data: bytes


Judge = Callable[[bytearray, int, bool], int | str]
"""Judges the bytes at an index: the size of the frame that begins there, `MORE`, or why there is none (perhaps "").

The third argument tells whether a frame ended right there.  An answer that more bytes could change is `MORE`, so that
frames and counts do not depend on how the stream was cut.
"""


class Cutter:
    """Cuts frames out of a stream: at each place where one may ``start``, ``judge`` decides.

    After a refusal the search goes on at the next byte, inside what was refused, so that no frame in it is lost.
    Memory is bounded by the largest frame of the judge and the chunk pushed.
    """

    def __init__(self, start: re.Pattern[bytes], judge: Judge, byte_ns: int) -> None:
        self.skipped = 0
        self.bad: Counter[str] = Counter()
        self._start = start
        self._judge = judge
        self._arrivals = Arrivals(byte_ns)
        self._buffer = bytearray()
        self._base = 0
        self._is_synced = False

    @property
    def pending(self) -> int:
        """Bytes held that may become a frame."""
        return len(self._buffer)

    def push(self, t_ns: int, data: bytes) -> list[Cut]:
        """Take bytes that arrived at ``t_ns`` and return the frames that they complete."""
        if not data:
            return []
        self._arrivals.note(t_ns, len(data))
        self._buffer += data
        return self._scan()

    def finish(self) -> list[Cut]:
        """End the stream: return frames inside the unfinished one, and count the bytes that are left as skipped."""
        cuts: list[Cut] = []
        while self._buffer:
            self._is_synced = False
            self.skipped += 1
            self._drop(1)
            cuts += self._scan()
        self._is_synced = False
        return cuts

    def _scan(self) -> list[Cut]:
        cuts: list[Cut] = []
        at = 0
        while (at := self._seek(at)) < len(self._buffer):
            verdict = self._judge(self._buffer, at, self._is_synced)
            if verdict == MORE:
                break
            if isinstance(verdict, str):
                if verdict:
                    self.bad[verdict] += 1
                self.skipped += 1
                self._is_synced = False
                at += 1
                continue
            cuts.append(Cut(self._arrivals.at(self._base + at), bytes(self._buffer[at : at + verdict])))
            self._is_synced = True
            at += verdict
        self._drop(at)
        return cuts

    def _seek(self, at: int) -> int:
        found = self._start.search(self._buffer, at)
        start = found.start() if found else len(self._buffer)
        if start > at:
            self.skipped += start - at
            self._is_synced = False
        return start

    def _drop(self, count: int) -> None:
        del self._buffer[:count]
        self._base += count
        self._arrivals.drop(self._base)
