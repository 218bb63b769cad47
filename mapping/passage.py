"""The pings between two scans, kept for the way."""

from __future__ import annotations

import numpy as np

from mapping.turns import Beam, steady_headings, step_of
from mapping.values import Way

WAY_PINGS = 4096
"""A way with more pings was not seen whole."""
WAY_AT_REST = 256
"""Pings at rest that a way begins with: its end is noticed late."""


class Passage:
    """Beams since the last scan; none before the first scan, and none where there were too many."""

    def __init__(self) -> None:
        self._beams: list[Beam] | None = None

    def add(self, beam: Beam, *, resting: bool) -> None:
        """Keep a beam; of a rest whose scan was given only the last ones."""
        if self._beams is None:
            return
        self._beams.append(beam)
        if resting:
            del self._beams[:-WAY_AT_REST]
        if len(self._beams) > WAY_PINGS:
            self._beams = None

    def lose(self) -> None:
        """Forget the way: it was not seen whole."""
        self._beams = None

    def way_to(self, start_ns: int) -> Way | None:
        """Give the pings from the scan before to one that starts now."""
        beams = [b for b in self._beams or [] if b.ping.t_ns < start_ns]
        if not beams:
            return None
        return Way(
            t_ns=np.array([b.ping.t_ns for b in beams], dtype=np.int64),
            direction_rad=steady_headings(beams) + [b.ping.bearing_rad for b in beams],
            echoes=np.stack([b.ping.echoes for b in beams]),
            bin_m=beams[0].ping.bin_m,
            step_rad=step_of(beams),
        )

    def begin(self, beams: list[Beam]) -> None:
        """Begin a way with the beams since the end of a scan."""
        self._beams = list(beams)
