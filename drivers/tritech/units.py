"""Units of Tritech heads and their SI counterparts (Tritech Seanet protocol; figures checked on recorded frames).

An angle is a count of 1/16 gradian: 6400 to the turn, 3200 ahead, growing clockwise seen from above an upright head.
A time is a count of 640 ns.
"""

from __future__ import annotations

import math
from typing import Final

TURN: Final = 6400
AHEAD: Final = 3200
MIN_INTERVAL: Final = 10
"""Shortest sampling interval that Tritech's software offers."""

MAX_INTERVAL: Final = 1500
MAX_BINS: Final = 800
"""What every head can do; a DST head takes up to 1500."""

_TICK_S: Final = 640e-9
_CLOCK_HZ: Final = 32e6
_INTERMEDIATE_HZ: Final = 455_000.0
_RANGE_UNITS_M: Final = (1.0, 0.3048, 1.8288, 0.9144)


def angle_rad(units: int) -> float:
    """Angle clockwise from the head's ahead, in [0, 2 pi), of a position in 1/16 gradian."""
    return (units - AHEAD) % TURN * (math.tau / TURN)


def angle_units(angle: float) -> int:
    """Position in 1/16 gradian, 0 to 6399, of an angle in radians clockwise from the head's ahead."""
    return (round(angle * (TURN / math.tau)) + AHEAD) % TURN


def step_units(step_deg: float) -> int:
    """Step in 1/16 gradian, 1 to 255."""
    return min(max(round(step_deg * (TURN / 360.0)), 1), 255)


def bin_m(interval: int, sound_speed_m_s: float) -> float:
    """Length of an echo bin: the sound goes there and back."""
    return sound_speed_m_s * interval * _TICK_S / 2.0


def sampling_ns(bins: int, interval: int) -> int:
    """Time from the beginning of a ping to its last echo."""
    return round(bins * interval * _TICK_S * 1e9)


def sampling(range_m: float, bins: int, sound_speed_m_s: float) -> tuple[int, int]:
    """Interval (640 ns) and number of bins that reach ``range_m``.

    The bins are as many as asked for, and the interval is rounded, so the reach is off by up to half an interval a
    bin; where the interval is at its limit, the number of bins changes instead.
    """
    wanted = round(2.0 * range_m / (sound_speed_m_s * bins * _TICK_S))
    interval = min(max(wanted, MIN_INTERVAL), MAX_INTERVAL)
    if interval != wanted:
        bins = min(max(round(range_m / bin_m(interval, sound_speed_m_s)), 1), MAX_BINS)
    return interval, bins


def gain_byte(gain_pct: float) -> int:
    """Return the initial gain, 0 to 210 for 0 to 100 %."""
    return min(max(round(gain_pct * 2.1), 0), 210)


def gain_pct(gain: int) -> float:
    """Return the initial gain in percent."""
    return gain / 2.1


def level_byte(level_db: float) -> int:
    """Echo level (ADLow, ADSpan), 0 to 255 for 0 to 80 dB."""
    return min(max(round(level_db * 255.0 / 80.0), 0), 255)


def level_db(level: int) -> float:
    """Echo level in dB."""
    return level * 80.0 / 255.0


def transmit_word(frequency_hz: float) -> int:
    """Transmitter frequency as the head's synthesiser takes it."""
    return int(frequency_hz * 2**32 / _CLOCK_HZ)


def receive_word(frequency_hz: float) -> int:
    """Receiver's mixer for a transmitter frequency."""
    return transmit_word(frequency_hz + _INTERMEDIATE_HZ)


def frequency_hz(word: int) -> float:
    """Frequency of a synthesiser word."""
    return word * _CLOCK_HZ / 2**32


def range_word(range_m: float) -> int:
    """Label of the range: decimetres, unit metres."""
    return min(round(range_m * 10.0), 0x3FFF)


def labelled_range_m(word: int) -> float:
    """Range that a label tells; its two upper bits are the unit (metres, feet, fathoms, yards)."""
    return (word & 0x3FFF) / 10.0 * _RANGE_UNITS_M[word >> 14]


def pulse_us(range_m: float) -> int:
    """Transmit pulse that Tritech's software uses for a range, within what it stores as limits (20 to 350 us)."""
    return min(max(round((range_m + 10.0) * 2.5), 20), 350)
