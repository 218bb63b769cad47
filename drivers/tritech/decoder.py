"""From the bytes of a Tritech head to pings."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass
from typing import Final

import numpy as np

from config.errors import FrameError
from config.schema import Sonar
from drivers.counters import Counters
from drivers.readings import HeadSettings, Ping, Reading
from drivers.tritech import units
from drivers.tritech.framing import Deframer, Frame
from drivers.tritech.headdata import PROFILER, Control, HeadData, HeadStatus, decode_head_data, echoes_of
from drivers.tritech.ids import MessageId, name_of
from drivers.tritech.settings import bow_angle_rad

_MOST_KNOWN: Final = 64
_ECHOES_AT: Final = 44
_EMPTY: Final = 45
"""Bytes of a reply without echoes."""


@dataclass(frozen=True, slots=True)
class _Like:
    """What pings share that were made with the same settings."""

    head: HeadSettings
    bin_m: float
    sampling_ns: int
    is_8_bit: bool


class TritechDecoder:
    """Pings of the configured head; other messages, and pings of other nodes, are only counted.

    Angles take the head's mounting into account: ``mount_deg`` turns them, ``inverted`` mirrors them.  The length of
    a bin comes from the head's own sampling interval and the configured speed of sound.

    A ping is dated when its sound went out: a head replies when it has heard the last echo, so that is when the reply
    began to come, less the time to the last bin.  A head that is still sending the reply before may have been earlier.
    """

    def __init__(self, sonar: Sonar) -> None:
        self._sonar = sonar
        self._deframer = Deframer(sonar.baud, is_wire=sonar.port.startswith("/"))
        self.frames: list[Frame] = []
        """What the last call completed, for the conversation with the head (`drivers.tritech.head`)."""
        self._frames: Counter[str] = Counter()
        self._refused: Counter[str] = Counter()
        self._known: dict[bytes, _Like | str] = {}
        self._bearings: dict[int, float] = {}

    @property
    def counters(self) -> Counters:
        """What was seen so far; ``bad`` also counts pings that a whole frame carried but that cannot be used."""
        bad = Counter(self._deframer.bad)
        bad.update(self._refused)
        return Counters(dict(self._frames), self._deframer.skipped, dict(bad))

    def push(self, t_ns: int, data: bytes) -> list[Reading]:
        """Take bytes that arrived at ``t_ns`` and return the pings that they complete."""
        return self._pings(self._deframer.push(t_ns, data))

    def expire(self, t_ns: int) -> list[Reading]:
        """Give up a frame that can no longer end in time, and return pings found inside it."""
        return self._pings(self._deframer.expire(t_ns))

    def finish(self) -> list[Reading]:
        """End the stream: return pings that hide in its unfinished frame."""
        return self._pings(self._deframer.finish())

    def _pings(self, frames: list[Frame]) -> list[Reading]:
        self.frames = frames
        readings: list[Reading] = []
        for frame in frames:
            self._frames[name_of(frame.message_id)] += 1
            if frame.message_id != MessageId.HEAD_DATA:
                continue
            ping = self._ping(frame)
            if isinstance(ping, Ping):
                readings.append(ping)
            else:
                self._refused[ping] += 1
        return readings

    def _ping(self, frame: Frame) -> Ping | str:
        """Ping of a frame, or the reason why there is none."""
        data = frame.data
        # Nearly all pings are like the one before, but for their bearing, their sweep code and their echoes.
        key = data[7:17] + data[18:40] + data[42:44]
        like = self._known.get(key)
        if like is None:
            like = self._read(frame)
            if len(self._known) >= _MOST_KNOWN:
                self._known.clear()
            self._known[key] = like
        if isinstance(like, str):
            return like
        position = int.from_bytes(data[40:42], "little")
        if position >= units.TURN:
            return "bearing"
        bearing_rad = self._bearings.get(position)
        if bearing_rad is None:
            bearing_rad = self._bearings[position] = bow_angle_rad(position, self._sonar)
        echoes = np.frombuffer(data, np.uint8, len(data) - _EMPTY, _ECHOES_AT)
        return Ping(
            t_ns=frame.t_ns - like.sampling_ns,
            bearing_rad=bearing_rad,
            bin_m=like.bin_m,
            echoes=echoes if like.is_8_bit else echoes_of(decode_head_data(frame)),
            head=like.head,
        )

    def _read(self, frame: Frame) -> _Like | str:
        """Return what all pings share whose heads are as this one's, or why they cannot be used."""
        if frame.source != self._sonar.node:
            return "other_node"
        try:
            data = decode_head_data(frame)
        except FrameError:
            return "several_packets"
        reason = _unusable(data)
        if reason is not None:
            return reason
        is_8_bit = Control.ADC_8_ON in data.control
        bins = len(data.bins) * (1 if is_8_bit else 2)
        return _Like(
            head=self._settings(data),
            bin_m=units.bin_m(data.ad_interval, self._sonar.sound_speed_m_s),
            sampling_ns=units.sampling_ns(bins, data.ad_interval),
            is_8_bit=is_8_bit,
        )

    def _settings(self, data: HeadData) -> HeadSettings:
        continuous = Control.CONTINUOUS in data.control
        limits = (0.0, 0.0) if continuous else self._limits_rad(data)
        return HeadSettings(
            range_m=units.labelled_range_m(data.range_scale),
            gain_pct=units.gain_pct(data.gain),
            ad_low_db=units.level_db(data.ad_low),
            ad_span_db=units.level_db(data.ad_span),
            step_rad=data.step * math.tau / units.TURN,
            continuous=continuous,
            left_rad=limits[0],
            right_rad=limits[1],
            clockwise=(Control.SCAN_RIGHT in data.control) != self._sonar.inverted,
        )

    def _limits_rad(self, data: HeadData) -> tuple[float, float]:
        left, right = (bow_angle_rad(limit, self._sonar) for limit in (data.left_limit, data.right_limit))
        return (right, left) if self._sonar.inverted else (left, right)


def _unusable(data: HeadData) -> str | None:
    """Reason why a ping must not be used: it would stand at a wrong bearing or have no length."""
    if data.status & HeadStatus.POWER_LOST:
        return "power_lost"
    if data.status & HeadStatus.MOTOR_ERROR:
        return "motor_error"
    if data.device_type == PROFILER:
        return "profiler"
    if data.ad_interval == 0 or not data.bins:
        return "no_echoes"
    return None
