"""The pace of a log."""

from __future__ import annotations

import time

from daemon.snapshots import Snapshot
from drivers.records import Record


class Pace:
    """Holds a replay back to ``speed`` times the log's pace."""

    def __init__(self, speed: float) -> None:
        self._speed = speed
        self._begun: tuple[int, float] | None = None

    def left_s(self, record: Record) -> float:
        """Return how long ``record`` must still wait."""
        if self._begun is None:
            self._begun = (record.t_ns, time.monotonic())
        t_ns, begun_s = self._begun
        return (record.t_ns - t_ns) / 1e9 / self._speed - (time.monotonic() - begun_s)

    def wait(self, record: Record, _told: list[Snapshot]) -> None:
        """Sleep until it is time for ``record``."""
        time.sleep(max(0.0, self.left_s(record)))
