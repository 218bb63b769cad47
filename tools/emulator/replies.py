"""What heads of both families tell: user block, settings in use, and the reply to a request.

DST heads (Micron, SeaSprite) ignore frequencies and channels; older heads do as they are told.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from drivers.tritech import units
from drivers.tritech.commands import Gains, HeadParameters
from drivers.tritech.headdata import Control, HeadData, HeadStatus
from drivers.tritech.messages import FpgaCalData, FpgaVersionData, Message, user_block
from tools.emulator.sweep import Beam

SERIAL: Final = 4711
_CHIRP_HZ: Final = 650_000.0
_ALWAYS: Final = Control.RAW | Control.HAS_MOTOR | Control.REPLY_ASL
_OBEYED: Final = Control.ADC_8_ON | Control.CONTINUOUS | Control.INVERT
_DST_TYPE: Final = 0x11
_OLD_TYPE: Final = 0x02


def greeting(*, dst: bool, half_duplex: bool) -> list[Message]:
    """Return what answers the request for the user block."""
    block = user_block(dst=dst, serial=SERIAL, half_duplex=half_duplex)
    return [block, FpgaCalData(bytes(66)), FpgaVersionData(bytes(14))] if dst else [block]


def with_gains(parameters: HeadParameters, gains: Gains) -> HeadParameters:
    """Take the levels of the channel that the head works on."""
    span, low, gain, slope = gains.ad_span_1, gains.ad_low_1, gains.gain_1, gains.slope_1
    if parameters.control & Control.CHANNEL_2:
        span, low, gain, slope = gains.ad_span_2, gains.ad_low_2, gains.gain_2, gains.slope_2
    levels = replace(parameters, ad_span=span, ad_low=low, gain_1=gain)
    return replace(levels, slope_2=slope) if parameters.control & Control.CHANNEL_2 else replace(levels, slope_1=slope)


def reply(
    settings: HeadParameters, beam: Beam, status: HeadStatus, echoes: NDArray[np.uint8], *, dst: bool
) -> HeadData:
    """Return the reply of a ping whose echoes are on the scale of 0 to 80 dB."""
    control = _ALWAYS | settings.control & _OBEYED | (Control.SCAN_RIGHT if beam.clockwise else 0)
    control |= Control.CHANNEL_2 if dst else settings.control & Control.CHANNEL_2
    data = HeadData(
        bearing=beam.bearing,
        bins=echoes.tobytes() if control & Control.ADC_8_ON else _nibbles(settings, echoes),
        ad_interval=settings.ad_interval,
        step=settings.step,
        left_limit=settings.left_limit,
        right_limit=settings.right_limit,
        range_scale=settings.range_scale,
        control=control,
        status=status,
        device_type=_DST_TYPE,
        sweep=beam.sweep,
        transmit_word=units.transmit_word(_CHIRP_HZ),
        gain=settings.gain_1,
        slope=settings.slope_1,
        ad_span=settings.ad_span,
        ad_low=settings.ad_low,
    )
    return data if dst else _of_old_head(data, settings)


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
