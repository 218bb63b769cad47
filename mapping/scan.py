"""From readings to stationary scans: each ping with heading and depth of its moment, each circle at rest as one scan.

Where the vehicle rests is found by the echoes (``mapping.circle``); the pings between two rests are kept for the way.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from config.schema import Map
from drivers.readings import Altitude, Depth, Heading, Odometry, Ping, Reading
from mapping.circle import Circle, CircleFinder, Quality
from mapping.compass import Track
from mapping.odometry import Odometer
from mapping.passage import Passage
from mapping.rest import profile
from mapping.turns import TURN, Attitude, Beam, next_beam, same_settings, steady_headings, step_of
from mapping.values import Scan

HOLD_NS = 1_000_000_000  # a ping waits this long for a heading at or after it
PARTIAL_RAD = math.radians(60.0)  # less is no scan


class ScanBuilder:
    """Collects readings and gives each stationary circle (or sector sweep) once."""

    def __init__(self, config: Map) -> None:
        self._config = config
        self._headings = Track(angular=True)
        self._depths = Track(angular=False)
        self._odometer = Odometer()
        self._held: list[Ping] = []
        self._circles = CircleFinder(config.min_range_m)
        self._passage = Passage()
        self._count = 0

    def push(self, reading: Reading) -> list[Scan]:
        """Take a reading; give the scans that it completes."""
        match reading:
            case Heading():
                self._headings.add(reading.t_ns, reading.heading_rad)
            case Depth():
                self._depths.add(reading.t_ns, reading.depth_m)
            case Odometry():
                self._odometer.add(reading, self._heading(reading.t_ns))
            case Altitude():
                return []
            case Ping():
                self._held.append(reading)
        return self._release(reading.t_ns)

    def finish(self) -> list[Scan]:
        """Take the end of the readings; give what is still open, a part of a circle at rest too."""
        scans = [scan for ping in self._held for scan in self._take(ping)]
        self._held.clear()
        return scans + self._restart()

    def _release(self, now_ns: int) -> list[Scan]:
        scans: list[Scan] = []
        while self._held and self._is_due(self._held[0], now_ns):
            scans += self._take(self._held.pop(0))
        return scans

    def _is_due(self, ping: Ping, now_ns: int) -> bool:
        known = len(self._headings) > 0 and self._headings.latest_ns >= ping.t_ns
        return known or now_ns - ping.t_ns >= HOLD_NS

    def _take(self, ping: Ping) -> list[Scan]:
        scans: list[Scan] = []
        beams = self._circles.beams
        if beams and not same_settings(beams[-1].ping, ping):
            scans, beams = self._restart(), []
            self._passage.lose()
        beam = next_beam(beams, ping, self._attitude(ping.t_ns), self._profile(ping))
        self._passage.add(beam, resting=self._circles.resting)
        return scans + self._scans(self._circles.push(beam))

    def _restart(self) -> list[Scan]:
        """Give what is still open, and begin anew."""
        scans = self._scans(self._circles.close())
        self._circles = CircleFinder(self._config.min_range_m, grainy=self._circles.grainy)
        return scans

    def _profile(self, ping: Ping) -> NDArray[np.float64]:
        return profile(ping.echoes, ping.bin_m, self._config.min_range_m)

    def _attitude(self, t_ns: int) -> Attitude:
        depth = self._depths.at(t_ns) if len(self._depths) else math.nan
        return Attitude(self._heading(t_ns), self._headings.rate(t_ns), depth)

    def _heading(self, t_ns: int) -> float:
        if len(self._headings):
            return self._headings.at(t_ns)
        return math.radians(self._config.heading_deg or 0.0)

    def _scans(self, circle: Circle | None) -> list[Scan]:
        """Make the scan of a circle; none of one that is too short."""
        if circle is None or abs(circle.beams[-1].turn_rad - circle.beams[0].turn_rad) < PARTIAL_RAD:
            return []
        scan = self._scan(circle.beams, circle.quality)
        self._passage.begin([b for b in self._circles.beams if b.ping.t_ns > scan.t_end_ns])
        self._count += 1
        return [scan]

    def _scan(self, beams: list[Beam], quality: Quality) -> Scan:
        start_ns, end_ns = beams[0].ping.t_ns, beams[-1].ping.t_ns
        headings = steady_headings(beams)
        reference = float(headings.mean())
        depths = self._depths.within(start_ns, end_ns)
        return Scan(
            index=self._count,
            t_start_ns=start_ns,
            t_end_ns=end_ns,
            heading_rad=reference % TURN,
            depth_m=float(np.median(depths)) if len(depths) else self._attitude(end_ns).depth_m,
            bearing_rad=np.array([b.ping.bearing_rad for b in beams]) + headings - reference,
            echoes=np.stack([b.ping.echoes for b in beams]),
            bin_m=beams[0].ping.bin_m,
            step_rad=step_of(beams),
            quality=quality,
            way=self._passage.way_to(start_ns),
            has_compass=len(self._headings) > 0,
            moved=self._odometer.since_last((start_ns + end_ns) // 2),
        )
