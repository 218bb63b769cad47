"""How far to trust a reading: opinions put together, jumps that no vehicle makes, and what was counted of them."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from typing import Final

from drivers.readings import Altitude, Depth, Heading, Odometry, Quality, Reading

_RANK: Final[dict[Quality, int]] = {"good": 0, "suspect": 1, "bad": 2}
_AGREE: Final = 3
"""So many readings in a row that agree with each other, and not with what was before, are believed."""


@dataclass(frozen=True, slots=True)
class Opinion:
    """A quality and why; the reason of what is good is empty."""

    quality: Quality = "good"
    reason: str = ""


GOOD: Final = Opinion()


def worst(*opinions: Opinion) -> Opinion:
    """Return the first of the worst opinions."""
    return max(opinions, key=lambda each: _RANK[each.quality])


@dataclass(slots=True)
class _Track:
    """Last value that was believed, and one that may take its place when others agree with it."""

    t_ns: int
    value: float
    rival_ns: int = 0
    rival: float = 0.0
    agreeing: int = 0


class JumpGate:
    """Finds values that change faster than ``limit_per_s``, beyond a ``slack`` for noise and resolution.

    Each source (a sentence of a feed) is compared with itself, for two sentences of one instrument may differ by
    their rounding or meaning.  A single jump is bad; one that stays is suspect once, and believed from then on: a
    compass that was realigned, or a first reading that was wrong.
    """

    def __init__(self, limit_per_s: float, slack: float, unit: str, turn: float | None = None) -> None:
        """``turn`` is the full circle of an angle in the same unit as the values; None for lengths."""
        self._limit_per_s = limit_per_s
        self._slack = slack
        self._unit = unit
        self._turn = turn
        self._tracks: dict[str, _Track] = {}

    def judge(self, source: str, t_ns: int, value: float) -> Opinion:
        """Return the opinion about a value, and remember it."""
        track = self._tracks.setdefault(source, _Track(t_ns, value))
        step = self._step(value, track.value)
        if step <= self._allowed(t_ns, track.t_ns):
            self._tracks[source] = _Track(t_ns, value)
            return GOOD
        reason = f"a jump of {step:.1f} {self._unit}"
        agrees = track.agreeing and self._step(value, track.rival) <= self._allowed(t_ns, track.rival_ns)
        track.agreeing = track.agreeing + 1 if agrees else 1
        track.rival_ns, track.rival = t_ns, value
        if track.agreeing < _AGREE:
            return Opinion("bad", reason)
        self._tracks[source] = _Track(t_ns, value)
        return Opinion("suspect", reason + " that stayed")

    def _step(self, a: float, b: float) -> float:
        apart = abs(a - b)
        return apart if self._turn is None else min(apart % self._turn, -apart % self._turn)

    def _allowed(self, t_ns: int, before_ns: int) -> float:
        return self._slack + self._limit_per_s * max(0, t_ns - before_ns) * 1e-9


class Tally:
    """Counts of a feed's readings by quality, why the last one was not good, and when the newest of each kind came."""

    def __init__(self) -> None:
        self.counts: Counter[Quality] = Counter()
        self.last_reason = ""
        self.newest_ns: dict[str, int] = {}
        """When the newest usable reading of each quantity was taken."""
        self.now: dict[str, Opinion] = {}
        """What the newest reading of each quantity is worth."""

    @property
    def total(self) -> int:
        """All readings so far."""
        return self.counts.total()

    def take(self, reading: Reading) -> None:
        """Count a reading of a feed."""
        if isinstance(reading, Heading | Depth | Altitude | Odometry):
            self.counts[reading.quality] += 1
            self.last_reason = reading.reason or self.last_reason
            quantity = type(reading).__name__.lower()
            self.now[quantity] = Opinion(reading.quality, reading.reason)
            if reading.quality != "bad":
                self.newest_ns[quantity] = reading.t_ns
