"""An emulated Tritech imaging head: bytes of the host in, bytes of the head out, at the pace of its line.

Timing: a ping takes as long as sound needs to its last bin or its reply needs on the line, whichever is longer, plus
some 10 ms for the motor; the head samples the next ping while it sends the last one's reply.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from config.errors import FrameError
from drivers.tritech import units
from drivers.tritech.commands import (
    Command,
    GainCommand,
    Gains,
    HeadCommand,
    HeadParameters,
    ReBoot,
    Reverse,
    SendBBUser,
    SendData,
    SendVersion,
    StopAlives,
    decode_command,
)
from drivers.tritech.framing import Deframer
from drivers.tritech.headdata import HeadStatus
from drivers.tritech.messages import Alive, AuxData, HeadInf, Message, VersionData, encode
from tools.emulator.line import Line, Wire
from tools.emulator.replies import SERIAL, greeting, reply, with_gains
from tools.emulator.sweep import Sweep

SECOND_NS: Final = 1_000_000_000
OVERHEAD_NS: Final = 10_000_000
TICK_NS: Final = 640
_IDLE_NS: Final = 1_500_000_000
_MOTOR_OFF_NS: Final = 3 * SECOND_NS
_MOST_OWED: Final = 8
_MOST_BINS: Final = 1500
_MOST_OLD_BINS: Final = 800
_LEAST_INTERVAL: Final = 5


@dataclass(frozen=True, slots=True)
class Sounding:
    """One ping as the world hears it: when, whither (clockwise from ahead), time between bins, bins, gain in dB."""

    t_ns: int
    bearing_rad: float
    interval_ns: int
    bins: int
    gain_db: float


Listen = Callable[[Sounding], NDArray[np.uint8]]
"""The world: echoes ``(bins,)`` on the scale of 0 to 80 dB."""


@dataclass(frozen=True, slots=True)
class HeadOptions:
    """What differs from head to head; ``replies_per_request`` is 1 on half-duplex lines.

    There both sides speak on one wire, and a request during a reply spoils both.  A head that is not ``dst`` has two
    channels, transmits with the frequencies that it is told, and turns otherwise (`sweep`).  ``aux_hz`` is how often
    an instrument on the auxiliary port speaks.
    """

    node: int = 2
    dst: bool = True
    baud: int = 115200
    replies_per_request: int = 2
    centring_s: float = 4.0
    wake_s: float = 0.6
    aux_hz: float = 0.0

    @property
    def half_duplex(self) -> bool:
        """Whether host and head share one wire."""
        return self.replies_per_request == 1


class Head:
    """The head: ``push`` what the host sends, ``tick`` for what it answers; it never looks at a clock."""

    def __init__(
        self,
        listen: Listen,
        options: HeadOptions | None = None,
        t_ns: int = 0,
        line: Wire | None = None,
        aux: Callable[[int], bytes] | None = None,
    ) -> None:
        """Switch on at ``t_ns``; ``aux`` is what the instrument on the auxiliary port says at a time."""
        self.options = options or HeadOptions()
        self.pings = 0
        self.last_request_ns: int | None = None
        self._listen = listen
        self._aux = aux
        self._line = line or Line(self.options.baud)
        self._sweep = Sweep(dst=self.options.dst)
        self._dark_until_ns: int | None = None
        self._next_aux_ns = t_ns
        self._reboot(t_ns)

    @property
    def settings(self) -> HeadParameters | None:
        """What the head is set to, or None before it was told."""
        return self._settings

    def cut_power(self, t_ns: int, until_ns: int) -> None:
        """Go dark until a time, and boot then."""
        self._dark_until_ns = max(until_ns, t_ns)
        self._line.clear()

    def fail(self, status: HeadStatus, lost_units: int = 0) -> None:
        """Say so with each ping until set again; the transducer is ``lost_units`` beyond where the head believes."""
        self._status |= status
        self._lost_units += lost_units

    def push(self, t_ns: int, data: bytes) -> None:
        """Take bytes from the host; what is no command to this head is passed over, as heads do."""
        if self._dark_until_ns is not None:
            return
        if self.options.half_duplex:
            data = self._line.collide(t_ns, data)
        for frame in self._deframer.push(t_ns, data):
            if frame.destination != self.options.node:
                continue
            try:
                self._obey(t_ns, decode_command(frame))
            except FrameError:
                continue

    def tick(self, t_ns: int) -> bytes:
        """Do what is due by ``t_ns`` and return the bytes that have reached the host since the last call."""
        if self._dark_until_ns is not None:
            if t_ns < self._dark_until_ns:
                return self._line.take(t_ns)
            self._reboot(self._dark_until_ns)
        while self._owed and self._settings and t_ns >= max(self._free_ns, self._asked_ns):
            self._ping(max(self._free_ns, self._asked_ns), self._settings)
        while self._answers and self._answers[0][0] <= t_ns:
            self._line.send(*self._answers.popleft())
        if t_ns >= self._next_alive_ns:
            self._alive(t_ns)
        if self._aux and self.options.aux_hz and t_ns >= self._next_aux_ns:
            self._next_aux_ns = t_ns + int(SECOND_NS / self.options.aux_hz)
            self._say(t_ns, AuxData(self._aux(t_ns)))
        return self._line.take(t_ns)

    def _reboot(self, t_ns: int) -> None:
        self._started_ns = self._asked_ns = t_ns
        self._ready_ns = self._free_ns = t_ns + int(self.options.centring_s * SECOND_NS)
        self._next_alive_ns = t_ns + SECOND_NS // 5
        self._last_ping_ns = t_ns - _MOTOR_OFF_NS
        self._alives, self._told_config = True, False
        self._settings: HeadParameters | None = None
        self._next_settings: tuple[int, HeadParameters] | None = None
        self._status, self._lost_units = HeadStatus.FULL_RANGE_8_BIT, 0
        self._dark_until_ns = None
        self._next_aux_ns = t_ns
        self._deframer = Deframer(self.options.baud)
        self._owed: int = 0
        self._answers: deque[tuple[int, bytes]] = deque()
        self._sweep.centre()
        self._line.clear()

    def _obey(self, t_ns: int, command: Command) -> None:
        match command:
            case SendData():
                self._ask(t_ns)
            case HeadCommand(parameters, gains):
                self._status, self._lost_units = HeadStatus.FULL_RANGE_8_BIT, 0
                self._set(with_gains(parameters, gains) if gains else parameters)
            case GainCommand(gains):
                self._set_gains(gains)
            case Reverse():
                self._sweep.reverse()
            case ReBoot():
                self._reboot(t_ns)
            case StopAlives():
                self._alives = False
            case SendVersion():
                self._say(t_ns, VersionData(0x31, 0x11, SERIAL, 45074, 0x2AEB, self.options.node))
            case SendBBUser():
                for message in greeting(dst=self.options.dst, half_duplex=self.options.half_duplex):
                    self._say(t_ns, message)

    def _say(self, t_ns: int, message: Message) -> None:
        self._line.send(t_ns, encode(message, self.options.node))

    def _set(self, settings: HeadParameters) -> None:
        most_bins = _MOST_BINS if self.options.dst else _MOST_OLD_BINS
        if not 1 <= settings.bins <= most_bins or settings.ad_interval < _LEAST_INTERVAL or not settings.step:
            return
        if self._settings is None:
            self._settings = settings
            self._sweep.limit(settings)
        else:
            # The ping under way and one more still go out with the old settings.
            self._next_settings = (self.pings + (1 if self._owed else 0), settings)

    def _set_gains(self, gains: Gains) -> None:
        latest = self._next_settings[1] if self._next_settings else self._settings
        if latest is not None:
            self._set(with_gains(latest, gains))

    def _ask(self, t_ns: int) -> None:
        if self._settings is None:
            return
        if not self._owed:
            asleep = t_ns - self._last_ping_ns > _MOTOR_OFF_NS
            self._asked_ns = t_ns + (int(self.options.wake_s * SECOND_NS) if asleep else 0)
        self._owed = min(self._owed + self.options.replies_per_request, _MOST_OWED)
        self.last_request_ns = t_ns

    def _ping(self, t_ns: int, settings: HeadParameters) -> None:
        if self._next_settings and self.pings >= self._next_settings[0]:
            self._settings = settings = self._next_settings[1]
            self._sweep.limit(settings)
            self._next_settings = None
        beam = self._sweep.next(settings)
        interval_ns = settings.ad_interval * TICK_NS
        gain_db = settings.gain_1 * 80.0 / 210.0
        towards_rad = units.angle_rad(beam.bearing + self._lost_units)
        echoes = self._listen(Sounding(t_ns, towards_rad, interval_ns, settings.bins, gain_db))
        data = reply(settings, beam, self._status, echoes, dst=self.options.dst)
        frame = encode(data, self.options.node)
        self._answers.append((t_ns + settings.bins * interval_ns, frame))
        wire_ns = len(frame) * 10 * SECOND_NS // self.options.baud
        self._free_ns = t_ns + max(settings.bins * interval_ns, wire_ns) + OVERHEAD_NS
        self._last_ping_ns = t_ns
        self.pings += 1
        self._owed -= 1

    def _alive(self, t_ns: int) -> None:
        """Send a heartbeat unless data are flowing: they are their own sign of life."""
        self._next_alive_ns = t_ns + SECOND_NS
        flowing = t_ns - self._last_ping_ns < _IDLE_NS or (self._owed and t_ns >= self._ready_ns)
        if self._alives and not flowing:
            t_ms = (t_ns - self._started_ns) // 1_000_000 & 0xFFFFFFFF
            info = self._info(t_ns)
            waiting = 0x80 if self._settings is None else 0
            self._say(t_ns, Alive(info, t_ms, self._sweep.bearing, waiting))

    def _info(self, t_ns: int) -> HeadInf:
        if t_ns < self._ready_ns:
            info = HeadInf.IN_CENTRE | HeadInf.MOTORING | HeadInf.MOTOR_ON | HeadInf.NO_PARAMETERS
            early = 2 * (t_ns - self._started_ns) < self._ready_ns - self._started_ns
            return info | HeadInf.CLOCKWISE if early else info
        info = HeadInf.CENTRED | HeadInf.MOTOR_ON
        if self._settings is None:
            return info | HeadInf.NO_PARAMETERS
        first, self._told_config = not self._told_config, True
        return info | HeadInf.CONFIG_SENT | (HeadInf.NO_PARAMETERS if first else HeadInf(0))
