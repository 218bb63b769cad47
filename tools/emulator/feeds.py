"""Compass and depth sensor of the emulated vehicle, as NMEA 0183 sentences on one slow line."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import reduce
from math import cos, degrees, radians, sin
from typing import Literal

import numpy as np

from tools.emulator.echoes import Place
from tools.emulator.line import Line, Wire

SECOND_NS = 1_000_000_000


@dataclass(frozen=True, slots=True)
class FeedOptions:
    """How the sensors err.  The compass reads magnetic: true heading less declination, plus bias and deviation.

    ``deviation_deg`` is the amplitude of a one-cycle deviation (hard iron), greatest at ``deviation_at_deg``.  A
    velocity log, where ``odometry_hz`` says that there is one, tells ways too long by a scale, from a mounting that is
    turned, with noise in each: its sum drifts.
    """

    baud: int = 4800
    heading_hz: float = 10.0
    depth_hz: float = 5.0
    sentence: Literal["HDG", "HDM"] = "HDG"
    heading_sd_deg: float = 0.3
    bias_deg: float = 1.0
    deviation_deg: float = 1.5
    deviation_at_deg: float = 60.0
    declination_deg: float = 0.0
    depth_sd_m: float = 0.01
    odometry_hz: float = 0.0
    odometry_scale: float = 1.02
    odometry_turned_deg: float = 1.0
    odometry_sd_m: float = 0.004


class NmeaFeed:
    """Sentences of compass (HDG or HDM), depth sensor (DPT: the vehicle's depth) and perhaps velocity log (DVPDL).

    They share one line, which paces them.
    """

    def __init__(
        self,
        where: Callable[[int], Place],
        rng: np.random.Generator,
        options: FeedOptions,
        line: Wire | None = None,
        is_stuck: Callable[[int], bool] = lambda _: False,
    ) -> None:
        """Sense ``where`` the vehicle is; while ``is_stuck`` the last sentences are said again."""
        self._where = where
        self._rng = rng
        self._options = options
        self._line = line or Line(options.baud)
        self._is_stuck = is_stuck
        self._log_rng = rng.spawn(1)[0] if options.odometry_hz else rng
        self._logged: tuple[int, Place] | None = None
        self._next_log_ns = 0
        self._said: dict[str, bytes] = {}
        self._next_heading_ns = 0
        self._next_depth_ns = int(SECOND_NS / options.heading_hz / 2)

    def tick(self, t_ns: int) -> bytes:
        """Return the bytes that have come by ``t_ns`` since the last call."""
        if t_ns >= self._next_heading_ns:
            self._next_heading_ns = t_ns + int(SECOND_NS / self._options.heading_hz)
            self._say(t_ns, "heading")
        if t_ns >= self._next_depth_ns:
            self._next_depth_ns = t_ns + int(SECOND_NS / self._options.depth_hz)
            self._say(t_ns, "depth")
        if self._options.odometry_hz and t_ns >= self._next_log_ns:
            self._next_log_ns = t_ns + int(SECOND_NS / self._options.odometry_hz)
            self._say(t_ns, "odometry")
        return self._line.take(t_ns)

    def _say(self, t_ns: int, what: Literal["heading", "depth", "odometry"]) -> None:
        if what not in self._said or not self._is_stuck(t_ns):
            place = self._where(t_ns)
            match what:
                case "heading":
                    self._said[what] = self._heading(place.heading_rad)
                case "depth":
                    self._said[what] = self._depth(place.depth_m)
                case _:
                    self._said[what] = self._odometry(t_ns, place)
        self._line.send(t_ns, self._said[what])

    def _odometry(self, t_ns: int, place: Place) -> bytes:
        """Return the way since the last one, in the body axes of now: ahead and to starboard."""
        before_ns, before = self._logged or (t_ns, place)
        self._logged = t_ns, place
        options = self._options
        east_m, north_m = place.x_m - before.x_m, place.y_m - before.y_m
        towards = place.heading_rad + radians(options.odometry_turned_deg)
        ahead_m = options.odometry_scale * (east_m * sin(towards) + north_m * cos(towards))
        right_m = options.odometry_scale * (east_m * cos(towards) - north_m * sin(towards))
        noise = options.odometry_sd_m * self._log_rng.standard_normal(2)
        dt_us = (t_ns - before_ns) // 1000
        body = f"DVPDL,{t_ns // 1000},{dt_us},0,0,0,{ahead_m + noise[0]:.4f},{right_m + noise[1]:.4f},0,100"
        return sentence(body)

    def _heading(self, heading_rad: float) -> bytes:
        options = self._options
        swing = options.deviation_deg * cos(heading_rad - radians(options.deviation_at_deg))
        reading = degrees(heading_rad) - options.declination_deg + options.bias_deg + swing
        reading = round((reading + options.heading_sd_deg * self._rng.standard_normal()) % 360.0, 1) % 360.0
        return sentence(f"HCHDG,{reading:.1f},,,," if options.sentence == "HDG" else f"HCHDM,{reading:.1f},M")

    def _depth(self, depth_m: float) -> bytes:
        reading = max(0.0, depth_m + self._options.depth_sd_m * self._rng.standard_normal())
        return sentence(f"SDDPT,{reading:.2f},0.0")


def sentence(body: str) -> bytes:
    """Return a whole NMEA sentence with its checksum."""
    return f"${body}*{reduce(lambda total, byte: total ^ byte, body.encode(), 0):02X}\r\n".encode()
