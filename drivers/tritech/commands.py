"""Commands from the host to a head, encoded and decoded (Tritech Seanet protocol).

The fixed commands and the head command come out byte for byte as Tritech's software writes them.  A command that
rewrites a head has no class here, and `drivers.tritech.framing.wrap` refuses its id.
"""

from __future__ import annotations

import struct
from dataclasses import astuple, dataclass
from typing import Final

from config.errors import FrameError
from drivers.tritech.framing import Frame, wrap_command
from drivers.tritech.headdata import Control
from drivers.tritech.ids import MessageId

_PARAMETERS: Final = struct.Struct("<HB4I4H4B2H2B4HHBBH")
_GAINS: Final = struct.Struct("<8B4H")
_TIME: Final = struct.Struct("<I")
_NORMAL, _WITH_GAINS, _GAINS_ONLY, _REVERSE = 0x01, 0x1D, 0x1E, 0x0F


@dataclass(frozen=True, slots=True)
class HeadParameters:
    """The 51 bytes of parameters of a head command, in the order and the units of the head.

    Angles in 1/16 gradian, ``pulse_us`` and ``lockout_us`` in microseconds, ``motor_time`` in 10 us, ``ad_interval``
    in 640 ns.  A DST head ignores the frequency words, the pulse and the slopes.
    """

    control: Control
    head_type: int
    transmit_1: int
    transmit_2: int
    receive_1: int
    receive_2: int
    pulse_us: int
    range_scale: int
    left_limit: int
    right_limit: int
    ad_span: int
    ad_low: int
    gain_1: int
    gain_2: int
    slope_1: int
    slope_2: int
    motor_time: int
    step: int
    ad_interval: int
    bins: int
    max_ad_buffer: int = 1000
    lockout_us: int = 100
    minor_axis: int = 1600
    major_axis: int = 1
    control_2: int = 0
    scan_z: int = 0


@dataclass(frozen=True, slots=True)
class Gains:
    """The 16 bytes of gains of a head with two channels: what each has, first channel 1, then channel 2."""

    ad_span_1: int
    ad_span_2: int
    ad_low_1: int
    ad_low_2: int
    gain_1: int
    gain_2: int
    set_point_1: int = 0
    set_point_2: int = 0
    slope_1: int = 90
    slope_2: int = 125
    slope_delay_1: int = 0
    slope_delay_2: int = 0


@dataclass(frozen=True, slots=True)
class SendVersion:
    """Ask for VersionData."""


@dataclass(frozen=True, slots=True)
class SendBBUser:
    """Ask for the block of settings."""


@dataclass(frozen=True, slots=True)
class ReBoot:
    """Restart the head; it centres its transducer and has no parameters afterwards."""


@dataclass(frozen=True, slots=True)
class StopAlives:
    """Silence Alive messages."""


@dataclass(frozen=True, slots=True)
class SendData:
    """Ask for pings; ``time_ms`` is the time of day that the head takes over."""

    time_ms: int = 0


@dataclass(frozen=True, slots=True)
class HeadCommand:
    """Set the head: form 0x01, or with ``gains`` form 0x1D."""

    parameters: HeadParameters
    gains: Gains | None = None


@dataclass(frozen=True, slots=True)
class GainCommand:
    """Change the gains while scanning: form 0x1E."""

    gains: Gains


@dataclass(frozen=True, slots=True)
class Reverse:
    """Turn the direction of the scan round: form 0x0F."""


Command = SendVersion | SendBBUser | ReBoot | StopAlives | SendData | HeadCommand | GainCommand | Reverse

_BARE: Final[dict[MessageId, Command]] = {
    MessageId.SEND_VERSION: SendVersion(),
    MessageId.SEND_BB_USER: SendBBUser(),
    MessageId.REBOOT: ReBoot(),
    MessageId.STOP_ALIVES: StopAlives(),
}
_BARE_IDS: Final = {type(command): message_id for message_id, command in _BARE.items()}


def encode_command(command: Command, head: int = 2) -> bytes:
    """Frame of a command to the head with that node.

    Raises FrameError where a field does not fit its bytes.
    """
    try:
        match command:
            case SendData(time_ms):
                return wrap_command(MessageId.SEND_DATA, _TIME.pack(time_ms), head)
            case HeadCommand() | GainCommand() | Reverse():
                return wrap_command(MessageId.HEAD_COMMAND, _head_command(command), head)
            case _:
                return wrap_command(_BARE_IDS[type(command)], b"", head)
    except struct.error as error:
        raise FrameError(f"a field of {type(command).__name__} does not fit its bytes: {error}") from None


def _head_command(command: HeadCommand | GainCommand | Reverse) -> bytes:
    match command:
        case HeadCommand(parameters, Gains() as gains):
            return bytes((_WITH_GAINS,)) + _PARAMETERS.pack(*astuple(parameters)) + _GAINS.pack(*astuple(gains))
        case HeadCommand(parameters):
            return bytes((_NORMAL,)) + _PARAMETERS.pack(*astuple(parameters))
        case GainCommand(gains):
            return bytes((_GAINS_ONLY,)) + _GAINS.pack(*astuple(gains))
        case Reverse():
            return bytes((_REVERSE,))


def decode_command(frame: Frame) -> Command:
    """Read a frame that the host sent; the inverse of `encode_command`.

    Raises FrameError for anything that is not one of these commands.
    """
    payload = frame.payload
    try:
        match frame.message_id:
            case MessageId.SEND_DATA:
                return SendData(*_TIME.unpack(payload))
            case MessageId.HEAD_COMMAND:
                return _read_head_command(payload)
            case other:
                return _BARE[MessageId(other)]
    except (struct.error, KeyError, ValueError):
        raise FrameError(f"message {frame.message_id} of {len(payload)} bytes is no command known here") from None


def _read_head_command(payload: bytes) -> Command:
    form, body = payload[0] if payload else None, payload[1:]
    if form == _REVERSE and not body:
        return Reverse()
    if form == _GAINS_ONLY:
        return GainCommand(Gains(*_GAINS.unpack(body)))
    if form not in (_NORMAL, _WITH_GAINS):
        raise FrameError(f"a head command of form {form} is not known here")
    control, *rest = _PARAMETERS.unpack(body[: _PARAMETERS.size])
    parameters = HeadParameters(Control(control), *rest)
    return HeadCommand(parameters, Gains(*_GAINS.unpack(body[_PARAMETERS.size :])) if form == _WITH_GAINS else None)
