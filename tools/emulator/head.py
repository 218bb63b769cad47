"""An emulated Tritech imaging head: bytes of the host in, bytes of the head out, at the pace of its line.

Timing: a ping takes as long as sound needs to its last bin or its reply needs on the line, whichever is longer, plus
some 10 ms for the motor; the head samples the next ping while it sends the last one's reply.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace
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
from drivers.tritech.headdata import Control, HeadData
from drivers.tritech.messages import (
    Alive,
    FpgaCalData,
    FpgaVersionData,
    HeadInf,
    Message,
    VersionData,
    encode,
    user_block,
)
from tools.emulator.line import Line
from tools.emulator.sweep import Sweep

SECOND_NS: Final = 1_000_000_000
OVERHEAD_NS: Final = 10_000_000
TICK_NS: Final = 640
_IDLE_NS: Final = 1_500_000_000
_MOTOR_OFF_NS: Final = 3 * SECOND_NS
_MOST_OWED: Final = 8
_MOST_BINS: Final = 1500
_LEAST_INTERVAL: Final = 5
_SERIAL: Final = 4711
_CHIRP_HZ: Final = 650_000.0
_ALWAYS: Final = Control.RAW | Control.HAS_MOTOR | Control.REPLY_ASL
_OBEYED: Final = Control.ADC_8_ON | Control.CONTINUOUS | Control.INVERT
_OLD_TYPE: Final = 0x02


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

    A head that is not ``dst`` has two channels and transmits with the frequencies that it is told.
    """

    node: int = 2
    dst: bool = True
    baud: int = 115200
    replies_per_request: int = 2
    centring_s: float = 4.0
    wake_s: float = 0.6


class Head:
    """The head: ``push`` what the host sends, ``tick`` for what it answers; it never looks at a clock."""

    def __init__(self, listen: Listen, options: HeadOptions | None = None, t_ns: int = 0) -> None:
        self.options = options or HeadOptions()
        self.pings = 0
        self.last_request_ns: int | None = None
        self._listen = listen
        self._line = Line(self.options.baud)
        self._deframer = Deframer(self.options.baud)
        self._sweep = Sweep()
        self._reboot(t_ns)

    @property
    def settings(self) -> HeadParameters | None:
        """What the head is set to, or None before it was told."""
        return self._settings

    def push(self, t_ns: int, data: bytes) -> None:
        """Take bytes from the host; what is no command to this head is passed over, as heads do."""
        for frame in self._deframer.push(t_ns, data):
            if frame.destination != self.options.node:
                continue
            try:
                self._obey(t_ns, decode_command(frame))
            except FrameError:
                continue

    def tick(self, t_ns: int) -> bytes:
        """Do what is due by ``t_ns`` and return the bytes that have reached the host since the last call."""
        while self._owed and self._settings and t_ns >= max(self._free_ns, self._asked_ns):
            self._ping(max(self._free_ns, self._asked_ns), self._settings)
        while self._answers and self._answers[0][0] <= t_ns:
            self._line.send(*self._answers.popleft())
        if t_ns >= self._next_alive_ns:
            self._alive(t_ns)
        return self._line.take(t_ns)

    def _reboot(self, t_ns: int) -> None:
        self._started_ns = self._asked_ns = t_ns
        self._ready_ns = self._free_ns = t_ns + int(self.options.centring_s * SECOND_NS)
        self._next_alive_ns = t_ns + SECOND_NS // 5
        self._last_ping_ns = t_ns - _MOTOR_OFF_NS
        self._alives, self._told_config = True, False
        self._settings: HeadParameters | None = None
        self._next_settings: tuple[int, HeadParameters] | None = None
        self._owed = 0
        self._answers: deque[tuple[int, bytes]] = deque()
        self._sweep.centre()
        self._line.clear()

    def _obey(self, t_ns: int, command: Command) -> None:
        match command:
            case SendData():
                self._ask(t_ns)
            case HeadCommand(parameters, gains):
                self._set(_with_gains(parameters, gains) if gains else parameters)
            case GainCommand(gains):
                latest = self._next_settings[1] if self._next_settings else self._settings
                if latest is not None:
                    self._set(_with_gains(latest, gains))
            case Reverse():
                self._sweep.reverse()
            case ReBoot():
                self._reboot(t_ns)
            case StopAlives():
                self._alives = False
            case SendVersion():
                self._say(t_ns, VersionData(0x31, 0x11, _SERIAL, 45074, 0x2AEB, self.options.node))
            case SendBBUser():
                self._say_block(t_ns)

    def _say_block(self, t_ns: int) -> None:
        dst, half_duplex = self.options.dst, self.options.replies_per_request == 1
        self._say(t_ns, user_block(dst=dst, serial=_SERIAL, half_duplex=half_duplex))
        if dst:
            self._say(t_ns, FpgaCalData(bytes(66)))
            self._say(t_ns, FpgaVersionData(bytes(14)))

    def _say(self, t_ns: int, message: Message) -> None:
        self._line.send(t_ns, encode(message, self.options.node))

    def _set(self, settings: HeadParameters) -> None:
        if not 1 <= settings.bins <= _MOST_BINS or settings.ad_interval < _LEAST_INTERVAL or not settings.step:
            return
        if self._settings is None:
            self._settings = settings
            self._sweep.limit(settings)
        else:
            # The ping under way and one more still go out with the old settings.
            self._next_settings = (self.pings + (1 if self._owed else 0), settings)

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
        sounding = Sounding(t_ns, units.angle_rad(beam.bearing), interval_ns, settings.bins, gain_db)
        control = _ALWAYS | settings.control & _OBEYED | (Control.SCAN_RIGHT if beam.clockwise else 0)
        control |= Control.CHANNEL_2 if self.options.dst else settings.control & Control.CHANNEL_2
        data = _reply(settings, control, beam.bearing, beam.sweep, self._listen(sounding))
        data = data if self.options.dst else _of_old_head(data, settings)
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


def _with_gains(parameters: HeadParameters, gains: Gains) -> HeadParameters:
    """Take the levels of the channel that the head works on."""
    span, low, gain, slope = gains.ad_span_1, gains.ad_low_1, gains.gain_1, gains.slope_1
    if parameters.control & Control.CHANNEL_2:
        span, low, gain, slope = gains.ad_span_2, gains.ad_low_2, gains.gain_2, gains.slope_2
    levels = replace(parameters, ad_span=span, ad_low=low, gain_1=gain)
    return replace(levels, slope_2=slope) if parameters.control & Control.CHANNEL_2 else replace(levels, slope_1=slope)


def _reply(settings: HeadParameters, control: Control, bearing: int, sweep: int, echoes: NDArray[np.uint8]) -> HeadData:
    return HeadData(
        bearing=bearing,
        bins=echoes.tobytes() if control & Control.ADC_8_ON else _nibbles(settings, echoes),
        ad_interval=settings.ad_interval,
        step=settings.step,
        left_limit=settings.left_limit,
        right_limit=settings.right_limit,
        range_scale=settings.range_scale,
        control=control,
        sweep=sweep,
        transmit_word=units.transmit_word(_CHIRP_HZ),
        gain=settings.gain_1,
        slope=settings.slope_1,
        ad_span=settings.ad_span,
        ad_low=settings.ad_low,
    )


def _of_old_head(data: HeadData, settings: HeadParameters) -> HeadData:
    """Make it the reply of a head that is not DST: its type, and the frequency and slope of the channel in use."""
    second = bool(settings.control & Control.CHANNEL_2)
    word, slope = (settings.transmit_2, settings.slope_2) if second else (settings.transmit_1, settings.slope_1)
    return replace(data, device_type=_OLD_TYPE, transmit_word=word, slope=slope)


def _nibbles(settings: HeadParameters, echoes: NDArray[np.uint8]) -> bytes:
    """Map ADLow to ADLow + ADSpan on 0 to 15 and pack two bins to the byte, the nearer one in the high half."""
    above = (echoes.astype(np.float64) - settings.ad_low) * (15.0 / max(settings.ad_span, 1))
    small = np.clip(np.round(above), 0, 15).astype(np.uint8)
    if len(small) % 2:
        small = np.append(small, np.uint8(0))
    return bytes((small[0::2] << 4) | small[1::2])
