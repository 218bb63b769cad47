"""From the configuration to the parameters of a head command."""

from __future__ import annotations

import math
from typing import Final

from config.schema import Sonar
from drivers.tritech import units
from drivers.tritech.commands import Gains, HeadCommand, HeadParameters
from drivers.tritech.headdata import USUAL_CONTROL, Control, HeadData

HEAD_TYPES: Final = {"dst": 0x11, "non-dst": 0x02}
_LOW_HZ, _HIGH_HZ = 325_000.0, 675_000.0
_AD_DB: Final = {8: (13.0, 24.0), 4: (10.5, 42.5)}
"""Least level and span of the echoes, by the bits of one: four bits must do for all levels that walls have."""

_MOTOR_TIME: Final = 25
_SLOPES: Final = (90, 125)

# A DST head sets these bits as it likes, whatever was asked for.
_KEPT: Final = Control.ADC_8_ON | Control.CONTINUOUS | Control.INVERT


def head_command(sonar: Sonar) -> HeadCommand:
    """Head command that sets a head as configured.

    The head is not told that it hangs upside down: what its INVERT bit means is described in contradicting ways, so
    that bit stays as Tritech's software sets it, and `bow_angle_rad` mirrors the angles, the sector's limits included.
    """
    interval, bins = units.sampling(sonar.range_m, sonar.bins, sonar.sound_speed_m_s)
    low, span = _levels(sonar)
    left, right = _limits(sonar)
    gain = units.gain_byte(sonar.gain_pct)
    old = sonar.head_type == "non-dst"
    return HeadCommand(
        HeadParameters(
            control=_control(sonar),
            head_type=HEAD_TYPES[sonar.head_type],
            transmit_1=units.transmit_word(_LOW_HZ) if old else 0,
            transmit_2=units.transmit_word(_HIGH_HZ) if old else 0,
            receive_1=units.receive_word(_LOW_HZ) if old else 0,
            receive_2=units.receive_word(_HIGH_HZ) if old else 0,
            pulse_us=units.pulse_us(sonar.range_m),
            range_scale=units.range_word(sonar.range_m),
            left_limit=left,
            right_limit=right,
            ad_span=span,
            ad_low=low,
            gain_1=gain,
            gain_2=gain,
            slope_1=_SLOPES[0],
            slope_2=_SLOPES[1],
            motor_time=_MOTOR_TIME,
            step=units.step_units(sonar.step_deg),
            ad_interval=interval,
            bins=bins + bins % 2 if sonar.bits == 4 else bins,  # two to the byte
        ),
        gains=gains(sonar) if sonar.dual_channel else None,
    )


def gains(sonar: Sonar) -> Gains:
    """Gains of both channels as configured: they are alike, so that it does not matter which one the head uses."""
    (low, span), gain = _levels(sonar), units.gain_byte(sonar.gain_pct)
    return Gains(span, span, low, low, gain, gain, slope_1=_SLOPES[0], slope_2=_SLOPES[1])


def bow_angle_rad(position: int, sonar: Sonar) -> float:
    """Angle clockwise from the bow, in [0, 2 pi), of a position that the head tells in 1/16 gradian."""
    angle = units.angle_rad(position)
    turned = math.radians(sonar.mount_deg) + (-angle if sonar.inverted else angle)
    # A tiny negative angle becomes a whole turn in floating point; that is the bow again.
    return 0.0 if (wrapped := turned % math.tau) >= math.tau else wrapped


def matches(data: HeadData, wanted: HeadParameters) -> bool:
    """Whether a ping was made with these parameters: replies queued before a change still carry the old ones."""
    same = (data.control & _KEPT) == (wanted.control & _KEPT)
    same = same and (data.step, data.ad_interval, data.gain) == (wanted.step, wanted.ad_interval, wanted.gain_1)
    same = same and _bins(data) == wanted.bins
    if wanted.control & Control.CONTINUOUS:
        return same
    return same and (data.left_limit, data.right_limit) == (wanted.left_limit, wanted.right_limit)


def _control(sonar: Sonar) -> Control:
    control = USUAL_CONTROL if sonar.bits == 8 else USUAL_CONTROL & ~Control.ADC_8_ON
    if sonar.sector_deg is None:
        control |= Control.CONTINUOUS
    return control | Control.CHANNEL_2 if sonar.channel == "high" else control


def _levels(sonar: Sonar) -> tuple[int, int]:
    low_db, span_db = _AD_DB[sonar.bits]
    return units.level_byte(low_db), units.level_byte(span_db)


def _bins(data: HeadData) -> int:
    return len(data.bins) if data.control & Control.ADC_8_ON else 2 * len(data.bins)


def _limits(sonar: Sonar) -> tuple[int, int]:
    if sonar.sector_deg is None:
        return 0, units.TURN - 1
    left, right = (math.radians(limit - sonar.mount_deg) for limit in sonar.sector_deg)
    if sonar.inverted:
        left, right = -right, -left
    return units.angle_units(left), units.angle_units(right)
