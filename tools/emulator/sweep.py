"""How a head's transducer turns: round and round, or to and fro between two limits.

Angles in 1/16 gradian: 6400 to the turn, 3200 ahead, growing clockwise.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from drivers.tritech.commands import HeadParameters
from drivers.tritech.headdata import Control
from drivers.tritech.units import AHEAD, TURN

NORMAL: Final = 0
AT_LEFT: Final = 1
AT_RIGHT: Final = 2
"""Sweep codes of a reply."""


@dataclass(frozen=True, slots=True)
class Beam:
    """Where the next ping goes, the direction of turning that its reply tells, and its sweep code."""

    bearing: int
    clockwise: bool
    sweep: int


class Sweep:
    """The motor's place and direction.

    A DST head goes round clockwise, and to and fro by whole steps from the right limit, meeting each limit once.  An
    older head, as recorded from a SeaKing, goes round as it is told; its bearings are multiples of the step, so that
    the outermost may lie a step outside the left limit, the beam at an end is made once for each direction, and the
    sweep code is never told.
    """

    def __init__(self, *, dst: bool = True) -> None:
        self.bearing = AHEAD
        self.clockwise = True
        self._dst = dst
        self._fresh = True

    def centre(self) -> None:
        """Turn ahead, as after power came."""
        self.bearing, self.clockwise, self._fresh = AHEAD, True, True

    def reverse(self) -> None:
        """Turn the other way from here."""
        self.clockwise = not self.clockwise

    def limit(self, settings: HeadParameters) -> None:
        """Obey new settings: a transducer outside a sector goes to the sector's nearer limit."""
        if not self._dst:
            self.clockwise = bool(settings.control & Control.SCAN_RIGHT)
            self.bearing = self.bearing // settings.step * settings.step
        left, span = _ends(settings, dst=self._dst)
        if settings.control & Control.CONTINUOUS or (self.bearing - left) % TURN <= span:
            return
        right = (left + span) % TURN
        to_left, to_right = (min((self.bearing - end) % TURN, (end - self.bearing) % TURN) for end in (left, right))
        self.bearing = left if to_left <= to_right else right
        self.clockwise = to_left <= to_right
        self._fresh = True

    def next(self, settings: HeadParameters) -> Beam:
        """Step once and return the beam there; the first beam after centring is where the transducer stands."""
        step = 0 if self._fresh else settings.step
        self._fresh = False
        if settings.control & Control.STARE:
            self.bearing = settings.left_limit
        elif settings.control & Control.CONTINUOUS:
            self.bearing = (self.bearing + (step if self.clockwise else -step)) % TURN
        else:
            return self._within(settings, step) if self._dst else self._between(settings, step)
        return Beam(self.bearing, self.clockwise, NORMAL)

    def _within(self, settings: HeadParameters, step: int) -> Beam:
        """Step a DST head to and fro; the reply at a limit already tells the direction of the way back."""
        left, span = _ends(settings, dst=True)
        place = (self.bearing - left) % TURN
        if step:
            from_right = span - place
            if self.clockwise:
                from_right = max(0, (from_right - 1) // step * step)
            else:
                from_right = min(span, (from_right // step + 1) * step)
            place = span - from_right
        self.bearing = (left + place) % TURN
        if place == span:
            self.clockwise = False
            return Beam(self.bearing, self.clockwise, AT_RIGHT)
        if place == 0:
            self.clockwise = True
            return Beam(self.bearing, self.clockwise, AT_LEFT)
        return Beam(self.bearing, self.clockwise, NORMAL)

    def _between(self, settings: HeadParameters, step: int) -> Beam:
        """Step an older head to and fro; it turns where it stands and pings there once more."""
        left, span = _ends(settings, dst=False)
        place = (self.bearing - left) % TURN + (step if self.clockwise else -step)
        if 0 <= place <= span:
            self.bearing = (left + place) % TURN
        else:
            self.clockwise = not self.clockwise
        return Beam(self.bearing, self.clockwise, NORMAL)


def _ends(settings: HeadParameters, *, dst: bool) -> tuple[int, int]:
    """Return the first bearing of a sector and how far it is from there to the last."""
    left, span = settings.left_limit, (settings.right_limit - settings.left_limit) % TURN
    if dst:
        return left, span
    before = left % settings.step
    return left - before, (span + before) // settings.step * settings.step
