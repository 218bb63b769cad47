"""From pieces of a foreign recording to the records of a log."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Final

from drivers.records import Chunk, ClockPair, Event, Json, Record
from tools.importers.capture import Captured

_CLOCK_NS: Final = 5_000_000_000
_PIECE_BYTES: Final = 32 << 10


@dataclass(frozen=True, slots=True)
class Clock:
    """Turns a recording's times into a log's: ``t_ns`` from 0 on and never back, UTC from the recording or a start.

    ``start_utc_ns`` is the UTC of the first piece where the recording does not tell it or the operator knows better.
    """

    first_t_ns: int
    shift_ns: int
    start_utc_ns: int | None

    def utc_ns(self, piece: Captured) -> int:
        """Return the UTC of ``piece``; without any date, the log begins at the epoch."""
        if self.start_utc_ns is None and piece.utc_ns is not None:
            return max(0, piece.utc_ns)
        return max(0, (self.start_utc_ns or 0) + piece.t_ns - self.first_t_ns)


def records(
    captured: Iterable[Captured], names: Mapping[str, str], clock: Clock, note: Mapping[str, Json]
) -> Iterator[Record]:
    """Yield the log: a pair of clocks (again every 5 s), a ``note`` of where it comes from, and the pieces in order.

    Where the recording's time goes back (a wall clock that was set), the monotonic time stands still.
    """
    latest = paired = None
    for piece in captured:
        latest = max(piece.t_ns + clock.shift_ns, latest or 0)
        utc_ns = clock.utc_ns(piece)
        if paired is None or latest - paired >= _CLOCK_NS:
            yield ClockPair(latest, utc_ns)
        if paired is None:
            yield Event(latest, utc_ns, "note", dict(note))
        if paired is None or latest - paired >= _CLOCK_NS:
            paired = latest
        for start in range(0, len(piece.data), _PIECE_BYTES):
            data = piece.data[start : start + _PIECE_BYTES]
            yield Chunk(latest, utc_ns, names[piece.line], piece.direction, data)
