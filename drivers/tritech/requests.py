"""When to ask a scanning head for more pings."""

from __future__ import annotations

from typing import Final

from drivers.tritech.commands import HeadParameters

_MOTOR_WAKES_NS: Final = 2_000_000_000
_LATE_NS: Final = 500_000_000
_SHORT_BEFORE_SINGLE: Final = 4
_TICK_NS: Final = 640


class RequestLoop:
    """Counts pings against requests, so that the head always has one to work on and never a queue of them.

    Most heads answer a request with two pings, half-duplex ones with one, and none tells which.  Two are expected:
    the next request then goes out with the first of them still to come, while the head samples.  Where the pings run
    out at one a request several times in a row, one is expected from then on; a lost ping must not change that.
    """

    def __init__(self) -> None:
        self.pings_per_request = 2
        self.unanswered = 0
        self._owed = self._requests = self._pings = 0
        self._short = 0
        self._slow_start = True
        self._waits_from_ns = 0
        self._limit_ns = _MOTOR_WAKES_NS

    @property
    def owed(self) -> int:
        """Pings that are still to come for the requests sent."""
        return self._owed

    def set_half_duplex(self, *, half_duplex: bool) -> None:
        """Take over what the head's settings block says: on such a line only one of the two may speak."""
        if half_duplex:
            self.pings_per_request = 1

    def begin(self, parameters: HeadParameters, baud: int) -> None:
        """Start to scan with these parameters: the first ping may take longer, because the motor was asleep."""
        sampling_ns = parameters.bins * parameters.ad_interval * _TICK_NS
        wire_ns = (parameters.bins + 45) * 10_000_000_000 // baud
        self._limit_ns = 2 * max(sampling_ns, wire_ns) + _LATE_NS
        self._slow_start = True
        self.unanswered = 0
        self._forget()

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
        return self._owed < self.pings_per_request

    def is_overdue(self, t_ns: int) -> bool:
        """Tell whether a ping should have come by now."""
        limit_ns = max(self._limit_ns, _MOTOR_WAKES_NS) if self._slow_start else self._limit_ns
        return t_ns - self._waits_from_ns > limit_ns

    def missed(self) -> None:
        """Note that a ping did not come: nothing is owed any more."""
        if self._pings == 0:
            self.unanswered += 1
        elif self._pings > self._requests:
            self._short = 0
        else:
            self._short += 1
            if self._short >= _SHORT_BEFORE_SINGLE:
                self.pings_per_request = 1
        self._forget()

    def _forget(self) -> None:
        self._owed = self._requests = self._pings = 0
