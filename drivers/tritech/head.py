"""The conversation with a Tritech head: bytes and times in, bytes to send out."""

from __future__ import annotations

from typing import Final

from config.errors import FrameError
from config.schema import Sonar
from drivers.tritech.commands import (
    Command,
    GainCommand,
    ReBoot,
    SendBBUser,
    SendData,
    SendVersion,
    encode_command,
)
from drivers.tritech.framing import Deframer, Frame
from drivers.tritech.headdata import HeadData, HeadStatus
from drivers.tritech.messages import Alive, BBUserData, Message, VersionData, decode
from drivers.tritech.pace import Limits
from drivers.tritech.requests import RequestLoop
from drivers.tritech.settings import gains, head_command, matches
from drivers.tritech.states import SECOND_NS, STEPS, TRANSITIONS, Event, Sends, State, event_of

_HUSH_NS: Final = 12 * SECOND_NS
_FLAGGED_PINGS: Final = 2
_OLD_PINGS: Final = 6
"""Replies with old settings after a change: those that two requests may owe, and two that the head works on."""

_RESENDS: Final = 2
_LOSSES: Final = 3
_LOST: Final = HeadStatus.POWER_LOST | HeadStatus.MOTOR_ERROR


class Head:
    """Brings a head from power-up to scanning, keeps it scanning, and recovers.

    Call `push` with what arrives and `tick` several times a second, both with times of one clock; send what they
    return.  `states` has the table.  Recoveries: a ping that stays away is asked for again, and after five the
    settings are sent again; so they are when the head lost power, its motor or its parameters, or answers with other
    settings; a head that goes on losing them, or never centres, is rebooted; one that is not heard is asked for
    its version, and rebooted once a minute.
    """

    def __init__(self, sonar: Sonar) -> None:
        self.version: VersionData | None = None
        self.user_block: BBUserData | None = None
        self.settings_differ = False
        self._deframer = Deframer(sonar.baud)
        self._requests = RequestLoop()
        self._sonar = sonar
        self._command = head_command(sonar)
        self._state = State.SILENT
        self._entered_ns: int | None = None
        self._due_ns = 0
        self._tries = 0
        self._heard_ns = 0
        self._refused = False
        self._news: Command | None = None
        self._old = self._resent = self._losses = self._flagged = 0

    @property
    def state(self) -> str:
        """Name of the state, for health: one of the values of `states.State`."""
        return self._state.value

    @property
    def sonar(self) -> Sonar:
        """Settings that the head has or is to have."""
        return self._sonar

    def push(self, t_ns: int, data: bytes) -> bytes:
        """Take bytes that arrived at ``t_ns``; return bytes to send."""
        return self.hear(t_ns, self._deframer.push(t_ns, data))

    def hear(self, t_ns: int, frames: list[Frame]) -> bytes:
        """Take frames that somebody else has cut out of what arrived; return bytes to send.  Not mixed with `push`."""
        self._start_clock(t_ns)
        return self._hear(t_ns, frames) + self._act(t_ns)

    def tick(self, t_ns: int) -> bytes:
        """Let time pass; return bytes to send."""
        self._start_clock(t_ns)
        return self._hear(t_ns, self._deframer.expire(t_ns)) + self._act(t_ns)

    @property
    def ping_s(self) -> float | None:
        """Measured time from ping to ping, or None where it is not known."""
        return self._requests.pace.ping_s if self._state is State.SCANNING else None

    @property
    def limits(self) -> Limits:
        """What sound and line need for a ping."""
        return self._requests.limits

    def change(self, sonar: Sonar) -> None:
        """Set the head differently, from the next `tick` or `push` on; half duplex, after the ping under way.

        A scanning head is asked on without a pause: a few replies may still have the old settings.  A change of the
        gain alone goes out as such; a head that does not take either is set anew like one that lost its settings.
        """
        is_gain = sonar == self._sonar.model_copy(update={"gain_pct": sonar.gain_pct})
        self._sonar = sonar
        self._command = head_command(sonar)
        self._old = self._resent = 0
        self.settings_differ = False
        if self._state is State.SCANNING:
            is_gain = is_gain and (self._news is None or isinstance(self._news, GainCommand))
            self._news = GainCommand(gains(sonar)) if is_gain else self._command
        elif self._state is State.SETTING:
            self._go(State.SETTING, None)

    def stop(self) -> None:
        """Ask for no more pings: the head finishes what it was asked for and idles, with its settings kept."""
        self._go(State.STOPPED, None)

    def start(self) -> None:
        """Scan again after `stop`."""
        if self._state is State.STOPPED:
            self._go(State.VERSION, None)

    def _start_clock(self, t_ns: int) -> None:
        if self._entered_ns is None:
            self._heard_ns = max(self._heard_ns, t_ns)
            self._entered_ns = t_ns
            self._due_ns = t_ns + STEPS[self._state].first_ns

    def _go(self, state: State, t_ns: int | None) -> None:
        """Enter a state; without a time, at the next one given."""
        self._state = state
        self._news = None
        self._tries = 0
        self._entered_ns = t_ns
        self._due_ns = 0 if t_ns is None else t_ns + STEPS[state].first_ns
        match state:
            case State.SETTING:
                self._refused = False
            case State.SCANNING:
                self._old = 0
                self._requests.begin(self._command.parameters, self._sonar.baud)
            case State.REBOOTING:
                self._losses = 0

    def _hear(self, t_ns: int, frames: list[Frame]) -> bytes:
        replies = b""
        for frame in frames:
            if frame.source != self._sonar.node:
                continue
            self._heard_ns = t_ns
            try:
                replies += self._take(t_ns, decode(frame))
            except FrameError:
                continue
        return replies

    def _take(self, t_ns: int, message: Message) -> bytes:
        event: Event | None = None
        match message:
            case Alive():
                event = event_of(message)
                self._refused = event is not Event.READY
            case VersionData():
                self.version = message
                event = Event.VERSION
            case BBUserData():
                self.user_block = message
                self._requests.set_half_duplex(half_duplex=message.half_duplex)
                event = Event.USER_BLOCK
            case HeadData():
                event = self._judge(message)
        state = TRANSITIONS.get((self._state, event)) if event else None
        if state is not None:
            self._go(State.REBOOTING if self._losses > _LOSSES else state, t_ns)
        elif isinstance(message, HeadData) and self._state is State.SCANNING and self._tries:
            return self._answered(t_ns)
        return b""

    def _answered(self, t_ns: int) -> bytes:
        more = self._requests.answered(t_ns)
        return self._tell_news() + (self._request(t_ns) if more else b"")

    def _tell_news(self) -> bytes:
        """Return the command that changes a scanning head, if there is one and the line is free."""
        news = self._news
        if news is None or not self._requests.may_speak:
            return b""
        self._news = None
        if not isinstance(news, GainCommand):
            self._requests.change(self._command.parameters, self._sonar.baud)
        return encode_command(news, self._sonar.node)

    def _judge(self, data: HeadData) -> Event | None:
        """Compare a ping with the settings sent; a few old ones may still be on their way after a change."""
        self._flagged = self._flagged + 1 if data.status & _LOST else 0
        if self._flagged:
            # A head repeats this until it is set again; noise on the line does not.
            if self._flagged < _FLAGGED_PINGS:
                return None
            self._losses += self._state is State.SCANNING
            return Event.LOST
        if matches(data, self._command.parameters):
            self._old = self._resent = self._losses = 0
            self.settings_differ = False
            return Event.PING
        self._old += 1
        if self._state is not State.SCANNING or self._old <= _OLD_PINGS or self._news is not None:
            return None
        if self._resent >= _RESENDS:
            # The head sets itself otherwise than it was told: better its pings than none.
            self.settings_differ = True
            return Event.PING
        self._old = 0
        self._resent += 1
        if self._resent == 1:
            self._news = self._command
            return None
        return Event.LOST

    def _act(self, t_ns: int) -> bytes:
        """Send what the state sends if its time has come; change the state if it was in vain."""
        if self._state not in (State.SILENT, State.REBOOTING, State.STOPPED) and t_ns - self._heard_ns > _HUSH_NS:
            self._go(State.SILENT, t_ns)
        step = STEPS[self._state]
        if self._state is State.SCANNING:
            return self._tell_news() + self._ask(t_ns, step.tries)
        if t_ns < self._due_ns:
            return b""
        if self._tries >= step.tries:
            return self._give_up(t_ns, step.then)
        self._tries += 1
        self._due_ns = t_ns + step.every_ns
        command = self._commands()[step.sends]
        return encode_command(command, self._sonar.node) if command else b""

    def _give_up(self, t_ns: int, then: State) -> bytes:
        in_vain = self._state is State.SETTING and self._refused
        self._go(State.REBOOTING if in_vain else then, t_ns)
        return self._act(t_ns)

    def _ask(self, t_ns: int, patience: int) -> bytes:
        if self._tries == 0:
            self._tries = 1
            return self._request(t_ns)
        if not self._requests.is_overdue(t_ns):
            return b""
        self._requests.missed()
        if self._requests.unanswered >= patience:
            self._go(State.SETTING, t_ns)
            return self._act(t_ns)
        return self._tell_news() + self._request(t_ns)

    def _request(self, t_ns: int) -> bytes:
        self._requests.asked(t_ns)
        return encode_command(SendData(), self._sonar.node)

    def _commands(self) -> dict[Sends, Command | None]:
        return {
            Sends.NOTHING: None,
            Sends.VERSION: SendVersion(),
            Sends.USER_BLOCK: SendBBUser(),
            Sends.SETTINGS: self._command,
            Sends.REBOOT: ReBoot(),
        }
