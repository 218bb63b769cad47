"""How fast pings follow each other, and what holds them up: the line, the sound's way, or something else."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import Final

OVERHEAD_S: Final = 0.010
"""What a head needs between two pings besides sound and line; recorded heads take 6 to 10 ms."""

WINDOW: Final = 16
_TOLERANCE: Final = 1.15
_PAUSE_NS: Final = 1_000_000_000
_FRAME_BYTES: Final = 45
_BITS: Final = 10


@dataclass(frozen=True, slots=True)
class Limits:
    """What a ping takes at least: ``sound_s`` to the last bin and back, ``line_s`` for its reply on the line.

    A head samples the next ping while it sends the reply to the last one, so the longer of the two rules; but where
    ``takes_turns``, on a half-duplex line, it is asked for the next only when the last has come.
    """

    sound_s: float
    line_s: float
    takes_turns: bool = False

    @property
    def ping_s(self) -> float:
        """Shortest time from ping to ping."""
        busy_s = self.sound_s + self.line_s if self.takes_turns else max(self.sound_s, self.line_s)
        return busy_s + OVERHEAD_S

    def ruling(self, ping_s: float) -> str:
        """Name what rules where pings follow after ``ping_s``: ``line``, ``sound``, or ``other``.

        The other is the head itself, a slow link, a busy computer, or damage on the line.
        """
        if ping_s > _TOLERANCE * self.ping_s:
            return "other"
        return "line" if self.line_s >= self.sound_s else "sound"


def limits(echo_bytes: int, sampling_s: float, baud: int, *, takes_turns: bool = False) -> Limits:
    """Return the limits of pings whose echoes take ``echo_bytes`` and are sampled for ``sampling_s``."""
    return Limits(sampling_s, (echo_bytes + _FRAME_BYTES) * _BITS / baud, takes_turns)


class Pace:
    """Mean time between pings over the last `WINDOW` of them; a pause of the head does not count."""

    def __init__(self) -> None:
        self._times_ns: deque[int] = deque(maxlen=WINDOW + 1)

    def ping(self, t_ns: int) -> None:
        """Note a ping that came at ``t_ns``."""
        if self._times_ns and t_ns - self._times_ns[-1] > _PAUSE_NS:
            self._times_ns.clear()
        self._times_ns.append(t_ns)

    def forget(self) -> None:
        """Measure anew."""
        self._times_ns.clear()

    @property
    def is_full(self) -> bool:
        """Whether the window is full."""
        return len(self._times_ns) > WINDOW

    @property
    def ping_s(self) -> float | None:
        """Mean time from ping to ping; None for fewer than two."""
        count = len(self._times_ns) - 1
        return (self._times_ns[-1] - self._times_ns[0]) / count / 1e9 if count > 0 else None
