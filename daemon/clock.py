"""The one clock of a run: monotonic and UTC time, read together."""

from __future__ import annotations

import time
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Clock:
    """Both times in ns.

    ``rate`` other than 1 stamps an emulated dive in emulated time; it runs from ``origin_ns`` (monotonic, UTC), which
    all processes of one run share so that a restarted one goes on where it was.
    """

    rate: float = 1.0
    origin_ns: tuple[int, int] = (0, 0)

    def now(self) -> tuple[int, int]:
        """Return ``(t_ns, utc_ns)``."""
        t_ns, utc_ns = time.monotonic_ns(), time.time_ns()
        if self.rate == 1.0:
            return t_ns, utc_ns
        passed = int((t_ns - self.origin_ns[0]) * self.rate)
        return self.origin_ns[0] + passed, self.origin_ns[1] + passed


def started(rate: float) -> Clock:
    """Return a clock of ``rate`` whose origin is now."""
    return Clock(rate, (time.monotonic_ns(), time.time_ns()))
