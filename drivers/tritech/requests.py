"""When to ask a scanning head for more pings."""

from __future__ import annotations

from typing import Final

from drivers.tritech.commands import HeadParameters
from drivers.tritech.headdata import Control
from drivers.tritech.pace import Limits, Pace, limits

_MOTOR_WAKES_NS: Final = 2_000_000_000
_LATE_S: Final = 0.5
_SHORT_BEFORE_SINGLE: Final = 4
_TICK_S: Final = 640e-9
_SLOWER: Final = 1.1
_QUICKER: Final = 0.95
_TRY_AGAIN: Final = 300
"""Pings after which an attempt that did not help is made again: a link that was busy then may be only slow now."""


class RequestLoop:
    """Counts pings against requests, so that the head always has one to work on and never a queue of them.

    Most heads answer a request with two pings, half-duplex ones with one, and none tells which.  Two are expected:
    the next request then goes out with the first of them still to come, while the head samples.  Where the pings run
    out at one a request several times in a row, one is expected from then on; a lost ping must not change that.

    On a link with a long round trip the head waits for each request.  Where pings come slower than sound and line
    allow, one more request is kept under way, and stays so if pings then come quicker; never more than that one, so
    that after a change of settings only a few replies are old ones, and never on a half-duplex line.
    """

    def __init__(self) -> None:
        self.pings_per_request = 2
        self.unanswered = 0
        self.pace = Pace()
        self.limits = Limits(0.0, 0.0)
        self._owed = self._requests = self._pings = 0
        self._short = 0
        self._slow_start = True
        self._is_excused = self._is_half_duplex = False
        self._is_ahead = self._has_tried = False
        self._before_s = 0.0
        self._since_try = 0
        self._waits_from_ns = 0
        self._limit_ns = _MOTOR_WAKES_NS

    @property
    def owed(self) -> int:
        """Pings that are still to come for the requests sent."""
        return self._owed

    @property
    def is_ahead(self) -> bool:
        """Whether one more request than usual is under way, because the link is slow."""
        return self._is_ahead

    @property
    def may_speak(self) -> bool:
        """Whether the line is free for a command: on a half-duplex one, not while a ping is to come."""
        return not (self._is_half_duplex and self._owed)

    def set_half_duplex(self, *, half_duplex: bool) -> None:
        """Take over what the head's settings block says: on such a line only one of the two may speak."""
        self._is_half_duplex = half_duplex
        if half_duplex:
            self.pings_per_request = 1
            self._is_ahead = False

    def begin(self, parameters: HeadParameters, baud: int) -> None:
        """Start to scan with these parameters: the first ping may take longer, because the motor was asleep."""
        self.change(parameters, baud)
        self.unanswered = 0
        self._is_ahead = False
        self._forget()

    def change(self, parameters: HeadParameters, baud: int) -> None:
        """Go on with other parameters: pings still owed may come, or be forgotten by the head, or come late."""
        sampling_s = parameters.bins * parameters.ad_interval * _TICK_S
        echo_bytes = parameters.bins if parameters.control & Control.ADC_8_ON else parameters.bins // 2
        self.limits = limits(echo_bytes, sampling_s, baud, takes_turns=self._is_half_duplex)
        slowest_s = max(self.limits.sound_s, self.limits.line_s)
        self._limit_ns = int((2 * slowest_s + _LATE_S) * 1e9)
        self._slow_start = self._is_excused = True
        self._has_tried = False
        self.pace.forget()

    def asked(self, t_ns: int) -> None:
        """Note that a request was sent."""
        self._waits_from_ns = t_ns
        self._owed += self.pings_per_request
        self._requests += 1

    def answered(self, t_ns: int) -> bool:
        """Note a ping; return whether it is time to ask for more."""
        self._waits_from_ns = t_ns
        self._slow_start = False
        self.unanswered = 0
        self._pings += 1
        self._owed = max(self._owed - 1, 0)
        self.pace.ping(t_ns)
        self._look_ahead()
        return self._owed < self.pings_per_request * (2 if self._is_ahead else 1)

    def is_overdue(self, t_ns: int) -> bool:
        """Tell whether a ping should have come by now."""
        limit_ns = max(self._limit_ns, _MOTOR_WAKES_NS) if self._slow_start else self._limit_ns
        return t_ns - self._waits_from_ns > limit_ns

    def missed(self) -> None:
        """Note that a ping did not come: nothing is owed any more."""
        if self._pings == 0:
            self.unanswered += 1
        elif self._pings > self._requests or self._is_excused:
            self._short = 0
        else:
            self._short += 1
            if self._short >= _SHORT_BEFORE_SINGLE:
                self.pings_per_request = 1
        self._is_excused = False
        self._forget()

    def _look_ahead(self) -> None:
        """Try one more request where pings come slowly; take it back where that did not help."""
        ping_s = self.pace.ping_s
        if not self.pace.is_full or ping_s is None or self._is_half_duplex:
            return
        self._is_excused = False
        self._since_try += 1
        if self._has_tried and (self._is_ahead or self._since_try < _TRY_AGAIN):
            if self._is_ahead and self._before_s and ping_s > _QUICKER * self._before_s:
                self._is_ahead = False
            self._before_s = 0.0
        elif ping_s > _SLOWER * self.limits.ping_s:
            self._has_tried = self._is_ahead = True
            self._since_try = 0
            self._before_s = ping_s
            self.pace.forget()

    def _forget(self) -> None:
        self._owed = self._requests = self._pings = 0
