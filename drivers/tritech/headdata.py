"""HeadData: the reply with the echoes of one ping (Tritech Seanet protocol, mtHeadData)."""

from __future__ import annotations

import struct
from dataclasses import dataclass
from enum import IntFlag
from typing import Final

import numpy as np
from numpy.typing import NDArray

from config.errors import FrameError
from drivers.tritech.framing import Frame, wrap_reply
from drivers.tritech.ids import MessageId

_HEADER: Final = struct.Struct("<HBBBHHIBHBBHHHHBHH")
_COUNTED: Final = 31
PROFILER: Final = 5
"""Device type of a profiling head, whose replies mean something else."""


class Control(IntFlag):
    """HdCtrl: how the head scans and samples."""

    ADC_8_ON = 0x0001
    CONTINUOUS = 0x0002
    SCAN_RIGHT = 0x0004
    INVERT = 0x0008
    MOTOR_OFF = 0x0010
    TRANSMITTER_OFF = 0x0020
    CHANNEL_2 = 0x0080
    RAW = 0x0100
    HAS_MOTOR = 0x0200
    APPLY_OFFSET = 0x0400
    PING_PONG = 0x0800
    STARE = 0x1000
    REPLY_ASL = 0x2000
    REPLY_THRESHOLD = 0x4000
    IGNORE_SENSOR = 0x8000


USUAL_CONTROL: Final = Control(0x230D)
"""8-bit echoes, a sector scanned clockwise, and the bits that Tritech's software always sets.

One of these is INVERT: with it, bearings grow clockwise in every recording made with that software.
"""


class HeadStatus(IntFlag):
    """What the head tells about itself with each ping."""

    POWER_LOST = 0x01
    MOTOR_ERROR = 0x02
    SYNC_ERROR = 0x04
    PING_ERROR = 0x08
    FULL_RANGE_8_BIT = 0x10
    APPENDED = 0x80


@dataclass(frozen=True, slots=True)
class HeadData:
    """One ping in the head's own units: angles in 1/16 gradian, ``ad_interval`` in 640 ns, ``range_scale`` a label.

    ``bins`` are the bytes as sent: one echo each, or two where `Control.ADC_8_ON` is not set in ``control``.
    """

    bearing: int
    bins: bytes
    ad_interval: int
    step: int
    left_limit: int
    right_limit: int
    range_scale: int = 0
    control: Control = USUAL_CONTROL
    status: HeadStatus = HeadStatus.FULL_RANGE_8_BIT
    device_type: int = 0x11
    sweep: int = 0
    transmit_word: int = 0
    gain: int = 0
    slope: int = 0
    ad_span: int = 0
    ad_low: int = 0
    heading_offset: int = 0


def decode_head_data(frame: Frame) -> HeadData:
    """Read a HeadData frame.

    Raises FrameError for one part of a message in several packets, which no known head sends unless set to, and for
    counts that contradict each other.
    """
    payload = frame.payload
    if frame.data[9] != 0:
        raise FrameError("HeadData in several packets; switch multi-packet mode off in the head")
    if len(payload) < _HEADER.size or len(payload) != _HEADER.size + int.from_bytes(payload[29:31], "little"):
        raise FrameError("HeadData whose count of echoes is not its size")
    fields = _HEADER.unpack_from(payload)
    return HeadData(
        device_type=fields[1],
        status=HeadStatus(fields[2]),
        sweep=fields[3],
        control=Control(fields[4]),
        range_scale=fields[5],
        transmit_word=fields[6],
        gain=fields[7],
        slope=fields[8],
        ad_span=fields[9],
        ad_low=fields[10],
        heading_offset=fields[11],
        ad_interval=fields[12],
        left_limit=fields[13],
        right_limit=fields[14],
        step=fields[15],
        bearing=fields[16],
        bins=payload[_HEADER.size :],
    )


def encode_head_data(data: HeadData, head: int = 2) -> bytes:
    """Frame of a HeadData message, as a head sends it."""
    header = _HEADER.pack(
        _COUNTED + len(data.bins),
        data.device_type,
        data.status,
        data.sweep,
        data.control,
        data.range_scale,
        data.transmit_word,
        data.gain,
        data.slope,
        data.ad_span,
        data.ad_low,
        data.heading_offset,
        data.ad_interval,
        data.left_limit,
        data.right_limit,
        data.step,
        data.bearing,
        len(data.bins),
    )
    return wrap_reply(MessageId.HEAD_DATA, header + data.bins, head)


def echoes_of(data: HeadData, *, high_nibble_first: bool = True) -> NDArray[np.uint8]:
    """Echoes ``(n,)`` uint8, 0 to 255 for 0 to 80 dB, read-only.

    A head that sends 4 bits has mapped ADLow to ADLow + ADSpan onto them; that is undone here, and 0, which says "at
    ADLow or below", stays 0.  Public drivers disagree which nibble comes first; most take the upper one.
    """
    packed = np.frombuffer(data.bins, dtype=np.uint8)
    if data.control & Control.ADC_8_ON:
        return packed
    halves = (packed >> 4, packed & 15) if high_nibble_first else (packed & 15, packed >> 4)
    nibbles = np.stack(halves, axis=1).reshape(-1)
    levels = np.minimum(data.ad_low + np.arange(16) * (data.ad_span / 15.0) + 0.5, 255.0).astype(np.uint8)
    levels[0] = 0
    echoes: NDArray[np.uint8] = levels[nibbles]
    echoes.flags.writeable = False
    return echoes
