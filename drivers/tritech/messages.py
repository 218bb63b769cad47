"""Messages from a head to the host, decoded and encoded (Tritech Seanet protocol)."""

from __future__ import annotations

import struct
from dataclasses import dataclass
from enum import IntFlag
from typing import Final

from config.errors import FrameError
from drivers.tritech.framing import Frame, wrap_reply
from drivers.tritech.headdata import HeadData, decode_head_data, encode_head_data
from drivers.tritech.ids import MessageId

_ALIVE: Final = struct.Struct("<BIHB")
_VERSION: Final = struct.Struct("<BBHIHB")
_VALID: Final = 0x1234
_DST_FAMILY: Final = 15
_DST_DUPLEX: Final = 146 - 13
_OLD_DUPLEX: Final = 99 - 13
_FREQUENCIES: Final = struct.Struct("<4H")
_FREQUENCIES_AT: Final = 101 - 13


class HeadInf(IntFlag):
    """State of the head in its Alive message; bit 0 is IN_CENTRE, as in Tritech's manual."""

    IN_CENTRE = 0x01
    CENTRED = 0x02
    MOTORING = 0x04
    MOTOR_ON = 0x08
    CLOCKWISE = 0x10
    IN_SCAN = 0x20
    NO_PARAMETERS = 0x40
    CONFIG_SENT = 0x80


@dataclass(frozen=True, slots=True)
class Alive:
    """Sent about once a second by an idle head; ``position`` is the transducer's, in 1/16 gradian."""

    info: HeadInf
    time_ms: int = 0
    position: int = 3200
    will_send: int = 0


@dataclass(frozen=True, slots=True)
class VersionData:
    """The head's program."""

    software: int
    info: int = 0
    serial: int = 0
    program_bytes: int = 0
    program_checksum: int = 0
    node: int = 2


@dataclass(frozen=True, slots=True)
class BBUserData:
    """The head's block of settings: 250 bytes, or 161 from older heads that are not DST."""

    block: bytes

    @property
    def valid(self) -> bool:
        """Whether the block carries its magic number."""
        return int.from_bytes(self.block[2:4], "little") == _VALID

    @property
    def serial(self) -> int:
        """Serial number of the unit."""
        return int.from_bytes(self.block[4:6], "little")

    @property
    def is_dst(self) -> bool:
        """Whether the head is of the DST family."""
        return self.block[6:7] == bytes((_DST_FAMILY,))

    @property
    def half_duplex(self) -> bool:
        """Whether the head must not be spoken to while it replies."""
        at = _DST_DUPLEX if self.is_dst else _OLD_DUPLEX
        return len(self.block) > at and self.block[at] == 1

    @property
    def frequencies_khz(self) -> tuple[int, ...]:
        """Transmit and receive frequencies of both channels, in kHz."""
        return _FREQUENCIES.unpack_from(self.block, _FREQUENCIES_AT)


@dataclass(frozen=True, slots=True)
class FpgaCalData:
    """Calibration that a DST head sends on its own; its content is not published."""

    block: bytes


@dataclass(frozen=True, slots=True)
class FpgaVersionData:
    """Version of a DST head's logic; its content is not published."""

    block: bytes


@dataclass(frozen=True, slots=True)
class AuxData:
    """Bytes from an instrument on the head's auxiliary port."""

    data: bytes


@dataclass(frozen=True, slots=True)
class Other:
    """Any other message."""

    message_id: int
    payload: bytes


Message = Alive | VersionData | BBUserData | HeadData | AuxData | FpgaCalData | FpgaVersionData | Other


def decode(frame: Frame) -> Message:
    """Read a frame that came from a head.

    Raises FrameError where a payload contradicts itself; frames from `Deframer` do so only if they are HeadData in
    several packets.
    """
    payload = frame.payload
    try:
        match frame.message_id:
            case MessageId.HEAD_DATA:
                return decode_head_data(frame)
            case MessageId.ALIVE:
                will_send, time_ms, position, info = _ALIVE.unpack(payload)
                return Alive(HeadInf(info), time_ms, position, will_send)
            case MessageId.VERSION_DATA:
                return VersionData(*_VERSION.unpack(payload))
            case _:
                return _decode_block(frame.message_id, payload)
    except struct.error as error:
        raise FrameError(f"message {frame.message_id} of {len(payload)} bytes: {error}") from None


def _decode_block(message_id: int, payload: bytes) -> Message:
    match message_id:
        case MessageId.BB_USER_DATA:
            return BBUserData(payload)
        case MessageId.AUX_DATA:
            return AuxData(payload[2:])
        case MessageId.FPGA_CAL_DATA:
            return FpgaCalData(payload)
        case MessageId.FPGA_VERSION_DATA:
            return FpgaVersionData(payload)
        case _:
            return Other(message_id, payload)


def encode(message: Message, head: int = 2) -> bytes:
    """Frame of a message, as the head with that node sends it; the inverse of `decode`."""
    match message:
        case HeadData():
            return encode_head_data(message, head)
        case Alive(info, time_ms, position, will_send):
            return wrap_reply(MessageId.ALIVE, _ALIVE.pack(will_send, time_ms, position, info), head)
        case VersionData(software, info, serial, size, checksum, node):
            return wrap_reply(MessageId.VERSION_DATA, _VERSION.pack(software, info, serial, size, checksum, node), head)
        case BBUserData(block):
            return wrap_reply(MessageId.BB_USER_DATA, block, head)
        case AuxData(data):
            return wrap_reply(MessageId.AUX_DATA, len(data).to_bytes(2, "little") + data, head)
        case FpgaCalData(block):
            return wrap_reply(MessageId.FPGA_CAL_DATA, block, head)
        case FpgaVersionData(block):
            return wrap_reply(MessageId.FPGA_VERSION_DATA, block, head)
        case Other(message_id, payload):
            return wrap_reply(message_id, payload, head)


def user_block(*, dst: bool = True, serial: int = 1, half_duplex: bool = False) -> BBUserData:
    """Make a block of settings with the fields whose meaning is known; everything else is zero."""
    block = bytearray(250)
    block[0:2] = b"\xff\x00"
    block[2:4] = _VALID.to_bytes(2, "little")
    block[4:6] = serial.to_bytes(2, "little")
    block[6] = _DST_FAMILY if dst else 0
    block[_DST_DUPLEX if dst else _OLD_DUPLEX] = int(half_duplex)
    _FREQUENCIES.pack_into(block, _FREQUENCIES_AT, 325, 675, 325, 675)
    return BBUserData(bytes(block))
