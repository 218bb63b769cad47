"""The log as the acquisition uses it: everything is stamped and recorded here first, and a full disk stops nothing."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Final

from config.errors import LogError
from daemon import snapshots
from daemon.clock import Clock
from daemon.snapshots import Snapshot
from drivers.log import LogWriter
from drivers.records import Chunk, ClockPair, Direction, Event, Json, Record

_PAIR_NS: Final = 5_000_000_000
_DISK_NS: Final = 5_000_000_000
_MIB: Final = 1 << 20


class Recorder:
    """Stamps with ``clock``, writes to ``writer``, and tells events to ``tell`` once they are written.

    A disk that refuses is an event and a line in health, told once; the acquisition goes on, and so does recording
    when the disk takes data again.
    """

    def __init__(
        self, writer: LogWriter, folder: Path, low_mib: float, clock: Clock, tell: Callable[[Snapshot], object]
    ) -> None:
        self._writer = writer
        self._folder = folder
        self._low_mib = low_mib
        self._clock = clock
        self._tell = tell
        self.error: str | None = None
        """Why the disk refuses, in words; None while it takes what comes."""
        self._is_low = False
        self._free_mib = 0.0
        self._pair_ns: int | None = None
        self._disk_ns: int | None = None
        self._bytes = 0

    def chunk(self, port: str, direction: Direction, data: bytes) -> Chunk:
        """Record bytes that came or are about to go; return them with their time."""
        chunk = Chunk(*self._clock.now(), port, direction, data)
        self._bytes += len(data)
        self._write(chunk)
        return chunk

    def event(self, kind: str, fields: dict[str, Json]) -> None:
        """Record and publish an event."""
        event = Event(*self._clock.now(), kind, fields)
        self._write(event)
        self._tell(snapshots.event(event))

    def tick(self, t_ns: int) -> None:
        """Do what is due at ``t_ns``: clock pairs, flushing, a look at the disk."""
        if self._pair_ns is None or t_ns - self._pair_ns >= _PAIR_NS:
            self._pair_ns = t_ns
            self._write(ClockPair(*self._clock.now()))
        if self._disk_ns is None or t_ns - self._disk_ns >= _DISK_NS:
            self._disk_ns = t_ns
            self._look_at_disk()
        self._guard(lambda: self._writer.tick(t_ns))

    def flush(self) -> str | None:
        """Hand everything to the operating system; return why that failed, or None."""
        self._guard(self._writer.flush)
        return self.error

    @property
    def is_syncing(self) -> bool:
        """Whether the disk is still at work on what was recorded."""
        return self._writer.is_syncing

    def start_sync(self) -> str | None:
        """Have everything brought to the disk meanwhile; return why that failed so far, or None."""
        self._guard(self._writer.start_sync)
        return self.error

    def close(self) -> None:
        """End the log; raise LogError where its end could not be written."""
        self._writer.close()

    def health(self) -> dict[str, Json]:
        """Return what health says of log and disk."""
        log: dict[str, Json] = {
            "file": self._writer.path.name,
            "raw_bytes": self._bytes,
            "lost_records": self._writer.lost_records,
            "error": self.error,
        }
        return {"log": log, "disk_free_mib": round(self._free_mib, 1), "disk_is_low": self._is_low}

    def _write(self, record: Record) -> None:
        self._guard(lambda: self._writer.write(record))

    def _guard(self, act: Callable[[], object]) -> None:
        """Do ``act``; a change between a disk that takes and one that refuses becomes one event."""
        try:
            act()
        except LogError as error:
            if self.error is None:
                self.error = str(error)
                self.event("disk", {"state": "refused", "message": self.error})
            return
        if self.error is not None and self._writer.is_writing:
            self.error = None
            self.event("disk", {"state": "writing again", "lost_records": self._writer.lost_records})

    def _look_at_disk(self) -> None:
        try:
            found = os.statvfs(self._folder)
        except OSError:
            return
        self._free_mib = found.f_bavail * found.f_frsize / _MIB
        is_low = self._free_mib < self._low_mib
        if is_low != self._is_low:
            self._is_low = is_low
            self.event("disk", {"state": "low" if is_low else "enough", "free_mib": round(self._free_mib, 1)})
