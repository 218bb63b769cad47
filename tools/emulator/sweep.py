"""How a head's transducer turns: round and round, or to and fro between two limits.

Angles in 1/16 gradian: 6400 to the turn, 3200 ahead, growing clockwise.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Protocol

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


class Sweep(Protocol):
    """The motor's place and direction."""

    bearing: int

    def centre(self) -> None:
        """Turn ahead, as after power came."""

    def reverse(self) -> None:
        """Turn the other way from here."""

    def limit(self, settings: HeadParameters) -> None:
        """Obey new settings."""

    def next(self, settings: HeadParameters) -> Beam:
        """Step once and return the beam there."""


class DstSweep:
    """A DST head's sweep."""

    def __init__(self) -> None:
        self.bearing = AHEAD
        self.clockwise = True
        self._fresh = True

    def centre(self) -> None:
        """Turn ahead, as after power came."""
        self.bearing, self.clockwise, self._fresh = AHEAD, True, True

    def reverse(self) -> None:
        """Turn the other way from here."""
        self.clockwise = not self.clockwise

    def limit(self, settings: HeadParameters) -> None:
        """Obey new settings: a transducer outside a sector goes to the sector's nearer limit."""
        if settings.control & Control.CONTINUOUS or _inside(self.bearing, settings):
            return
        to_left = min((self.bearing - settings.left_limit) % TURN, (settings.left_limit - self.bearing) % TURN)
        to_right = min((self.bearing - settings.right_limit) % TURN, (settings.right_limit - self.bearing) % TURN)
        self.bearing = settings.left_limit if to_left <= to_right else settings.right_limit
        self.clockwise = to_left <= to_right
        self._fresh = True

    def next(self, settings: HeadParameters) -> Beam:
        """Step once and return the beam there; the first beam after centring is where the transducer stands."""
        step = 0 if self._fresh else settings.step
        self._fresh = False
        if settings.control & Control.STARE:
            self.bearing = settings.left_limit
            return Beam(self.bearing, self.clockwise, NORMAL)
        if settings.control & Control.CONTINUOUS:
            self.bearing = (self.bearing + (step if self.clockwise else -step)) % TURN
            return Beam(self.bearing, self.clockwise, NORMAL)
        return self._within(settings, step)

    def _within(self, settings: HeadParameters, step: int) -> Beam:
        """Step to and fro: beams lie whole steps from the right limit both ways, and each limit is met once.

        So do real DST heads; the reply at a limit already tells the direction of the way back.
        """
        span = (settings.right_limit - settings.left_limit) % TURN
        place = (self.bearing - settings.left_limit) % TURN
        if step:
            from_right = span - place
            if self.clockwise:
                from_right = max(0, (from_right - 1) // step * step)
            else:
                from_right = min(span, (from_right // step + 1) * step)
            place = span - from_right
        self.bearing = (settings.left_limit + place) % TURN
        if place == span:
            self.clockwise = False
            return Beam(self.bearing, self.clockwise, AT_RIGHT)
        if place == 0:
            self.clockwise = True
            return Beam(self.bearing, self.clockwise, AT_LEFT)
        return Beam(self.bearing, self.clockwise, NORMAL)


class OldSweep:
    """The sweep of a head that is not DST, as recorded from a SeaKing.

    Bearings are multiples of the step, so that the outermost ones may lie a step outside the left limit; a beam at an
    end is made twice, once for each direction; the sweep code is never told.
    """

    def __init__(self) -> None:
        self.bearing = AHEAD
        self.clockwise = True
        self._fresh = True

    def centre(self) -> None:
        """Turn ahead, as after power came."""
        self.bearing, self.clockwise, self._fresh = AHEAD, True, True

    def reverse(self) -> None:
        """Turn the other way from here."""
        self.clockwise = not self.clockwise

    def limit(self, settings: HeadParameters) -> None:
        """Obey new settings, the direction among them; a transducer outside a sector goes to its left end."""
        self.clockwise = bool(settings.control & Control.SCAN_RIGHT)
        self.bearing = self.bearing // settings.step * settings.step
        self._fresh = True
        first, span = _ends(settings)
        if not settings.control & Control.CONTINUOUS and (self.bearing - first) % TURN > span:
            self.bearing, self.clockwise = first, True

    def next(self, settings: HeadParameters) -> Beam:
        """Step once and return the beam there; an end is answered where it stands before the way back begins."""
        if settings.control & Control.STARE:
            self.bearing = settings.left_limit
        elif self._fresh:
            self._fresh = False
        elif settings.control & Control.CONTINUOUS:
            self.bearing = (self.bearing + (settings.step if self.clockwise else -settings.step)) % TURN
        else:
            first, span = _ends(settings)
            place = (self.bearing - first) % TURN + (settings.step if self.clockwise else -settings.step)
            if 0 <= place <= span:
                self.bearing = (first + place) % TURN
            else:
                self.clockwise = not self.clockwise
        return Beam(self.bearing, self.clockwise, NORMAL)


def _ends(settings: HeadParameters) -> tuple[int, int]:
    """Return the first bearing of an old head's sector and how far it is to the last, both whole steps."""
    step = settings.step
    first = settings.left_limit // step * step
    span = (settings.right_limit - settings.left_limit) % TURN + settings.left_limit - first
    return first, span // step * step


def _inside(bearing: int, settings: HeadParameters) -> bool:
    return (bearing - settings.left_limit) % TURN <= (settings.right_limit - settings.left_limit) % TURN
