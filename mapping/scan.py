"""From readings to stationary scans: a full circle at rest is found by itself, without odometry.

The vehicle is at rest where the beams of a new turn see what the turn before saw (``mapping.rest``), the heading does
not race and the depth holds.  One rest gives one scan, however long it lasts: a vehicle that does not move sees the
same speckle again, and seeing it twice proves nothing.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from config.schema import Map
from drivers.readings import Altitude, Depth, Heading, Ping, Reading
from mapping.compass import Track, wrap
from mapping.rest import SECTOR_BEAMS, Agreement, compare, profile, still
from mapping.values import Scan

HOLD_NS = 1_000_000_000
"""A ping waits this long for a heading at or after it."""
TURN = 2.0 * math.pi
CONFIRM_RAD = math.radians(120.0)
"""A circle is believed when this much of the next turn agrees with it: who drives along a wall sees that one wall
unchanged, but hardly over more than this."""
CONFIRM_LEFT_RAD = math.radians(80.0)
"""... or this much, where the vehicle then leaves and its heading was steady."""
CONFIRM_END_RAD = math.radians(30.0)
"""... or this much, where the log ends."""
STEADY_RAD = math.radians(12.0)
"""The heading's range within a circle at rest and the beams that confirm it."""
STEADY_LATE_RAD = math.radians(4.0)
SWEEP_SHARE = 0.75
"""Share of a sector sweep that the sweep back must confirm."""
PARTIAL_RAD = math.radians(60.0)
"""Arcs smaller than this are no scan."""
UNSTEADY_PINGS = 5
"""Consecutive beams that disagree: the vehicle moved."""
RACE_RAD_S = math.radians(8.0)
DEPTH_STEP_M = 0.4
KEEP_TURNS = 2.2
MAX_PINGS = 8192
"""Bound of the buffer when the head does not turn."""

Quality = Literal["full", "partial", "moving"]


@dataclass(frozen=True, slots=True)
class _Beam:
    """A ping with the heading of its moment; ``turn_rad`` is its direction, unwrapped along the head's rotation."""

    ping: Ping
    heading_rad: float
    turn_rad: float
    leg: int
    profile: NDArray[np.float64]


class ScanBuilder:
    """Collects readings and gives each stationary circle (or sector sweep) once."""

    def __init__(self, config: Map) -> None:
        self._config = config
        self._headings = Track(angular=True)
        self._depths = Track(angular=False)
        self._held: list[Ping] = []
        self._count = 0
        self._restart()

    def push(self, reading: Reading) -> list[Scan]:
        """Take a reading; give the scans that it completes."""
        match reading:
            case Heading():
                self._headings.add(reading.t_ns, reading.heading_rad)
            case Depth():
                self._depths.add(reading.t_ns, reading.depth_m)
            case Altitude():
                return []
            case Ping():
                self._held.append(reading)
        return self._release(reading.t_ns)

    def finish(self) -> list[Scan]:
        """Take the end of the readings; give what is still open, a part of a circle at rest too."""
        scans = [scan for ping in self._held for scan in self._take(ping)]
        self._held.clear()
        scans += self._close()
        self._restart()
        return scans

    def _restart(self) -> None:
        self._beams: list[_Beam] = []
        self._recent: list[Agreement] = []
        self._run: list[tuple[int, int]] = []  # steady beams and their partners, as indices into _beams
        self._unsteady = 0
        self._resting = False
        self._moved = False

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
        if self._beams and not _same_settings(self._beams[-1].ping, ping):
            scans = self._close()
            self._restart()
        self._beams.append(self._beam(ping))
        partner = self._partner()
        if partner is not None:
            scans += self._judge(partner)
        self._trim()
        return scans

    def _beam(self, ping: Ping) -> _Beam:
        heading = self._heading(ping.t_ns)
        direction = heading + ping.bearing_rad
        shape = profile(ping.echoes, ping.bin_m, self._config.min_range_m)
        if not self._beams:
            return _Beam(ping, heading, direction, 0, shape)
        last = self._beams[-1]
        step = wrap(ping.bearing_rad - last.ping.bearing_rad)
        turn = last.turn_rad + step + wrap(heading - last.heading_rad)
        return _Beam(ping, heading, turn, last.leg + int(self._reverses(step)), shape)

    def _reverses(self, step_rad: float) -> bool:
        """Whether the head turns round; a bearing that is told twice at a limit does not."""
        for later, earlier in zip(reversed(self._beams[1:]), reversed(self._beams[:-1]), strict=True):
            before = wrap(later.ping.bearing_rad - earlier.ping.bearing_rad)
            if before:
                return step_rad * before < 0.0
        return False

    def _heading(self, t_ns: int) -> float:
        if len(self._headings):
            return self._headings.at(t_ns)
        return math.radians(self._config.heading_deg or 0.0)

    def _partner(self) -> int | None:
        """Index of the beam that looked the same way a turn before, or in the sweep before."""
        last = self._beams[-1]
        turns = np.array([b.turn_rad for b in self._beams[:-1]])
        legs = np.array([b.leg for b in self._beams[:-1]])
        away = np.where(legs == last.leg, np.abs(np.abs(turns - last.turn_rad) - TURN), np.inf)
        away = np.where(legs == last.leg - 1, np.abs(turns - last.turn_rad), away)
        if not len(away) or away.min() > 0.75 * last.ping.head.step_rad:
            return None
        return int(np.argmin(away))

    def _judge(self, partner: int) -> list[Scan]:
        now, before = self._beams[-1], self._beams[partner]
        self._recent.append(compare(now.profile, before.profile, now.ping.bin_m))
        del self._recent[:-SECTOR_BEAMS]
        verdict = still(self._recent)
        if self._races(now, before):
            verdict = False
        if verdict is False:
            return self._disagree()
        if verdict:
            self._unsteady = 0
        self._run.append((len(self._beams) - 1, partner))
        if self._resting or self._agreed_rad() < self._needed_rad() or self._swing_rad() > STEADY_RAD:
            return []
        return self._emit(0.8)

    def _races(self, now: _Beam, before: _Beam) -> bool:
        if abs(self._headings.rate(now.ping.t_ns)) > RACE_RAD_S:
            return True
        if len(self._depths) == 0:
            return False
        return abs(self._depths.at(now.ping.t_ns) - self._depths.at(before.ping.t_ns)) > DEPTH_STEP_M

    def _disagree(self) -> list[Scan]:
        self._unsteady += 1
        if self._unsteady < UNSTEADY_PINGS:
            return []
        scans = self._emit(0.5) if self._confirmed_late(CONFIRM_LEFT_RAD) else []
        self._resting = False
        self._moved = True
        self._run.clear()
        return scans

    def _agreed_rad(self) -> float:
        if not self._run:
            return 0.0
        return abs(self._beams[self._run[-1][0]].turn_rad - self._beams[self._run[0][0]].turn_rad)

    def _confirmed_late(self, needed_rad: float) -> bool:
        enough = self._agreed_rad() >= needed_rad and self._swing_rad() <= STEADY_LATE_RAD
        return enough and not self._resting and not self._sweeping()

    def _swing_rad(self) -> float:
        """Range of the heading over the circle and the beams that confirm it."""
        beams = self._beams[self._run[0][1] : self._run[-1][0] + 1]
        t_ns = np.array([b.ping.t_ns for b in beams], dtype=np.int64)
        return float(np.ptp(_smooth(t_ns, np.array([b.heading_rad for b in beams]))))

    def _sweeping(self) -> bool:
        return self._beams[-1].leg != self._beams[0].leg

    def _needed_rad(self) -> float:
        if not self._sweeping():
            return CONFIRM_RAD
        return max(CONFIRM_RAD, SWEEP_SHARE * self._sweep_rad(self._beams[self._run[-1][1]].leg))

    def _sweep_rad(self, leg: int) -> float:
        turns = [b.turn_rad for b in self._beams if b.leg == leg]
        return max(turns) - min(turns) if turns else 0.0

    def _emit(self, settled: float) -> list[Scan]:
        """Give a circle of those that agree, or the sweep that was confirmed.

        ``settled`` chooses the circle, 0 the first, 1 the last: the first ones may hold the end of the drift in, the
        last ones the beginning of the way out.
        """
        first, partner = self._run[int(settled * (len(self._run) - 1))]
        leg = self._beams[self._run[-1][1]].leg
        self._resting = True
        if self._sweeping():
            return self._scan([b for b in self._beams if b.leg == leg], "partial")
        return self._scan(self._beams[partner:first], "full")

    def _close(self) -> list[Scan]:
        """Give what the buffer holds at the end of a log or of a setting."""
        if self._confirmed_late(CONFIRM_END_RAD):
            return self._emit(0.5)
        if self._resting or self._moved or not self._beams:
            return []
        leg = max({b.leg for b in self._beams}, key=self._sweep_rad)
        beams = [b for b in self._beams if b.leg == leg]
        turned = [i for i, b in enumerate(beams) if abs(b.turn_rad - beams[0].turn_rad) >= TURN - 0.5 * _step(beams)]
        beams = beams[: turned[0]] if turned else beams
        whole = abs(beams[-1].turn_rad - beams[0].turn_rad) >= TURN - 1.5 * _step(beams)
        return self._scan(beams, "full" if whole else "partial")

    def _scan(self, beams: list[_Beam], quality: Quality) -> list[Scan]:
        if not beams or abs(beams[-1].turn_rad - beams[0].turn_rad) < PARTIAL_RAD:
            return []
        t_ns = np.array([b.ping.t_ns for b in beams], dtype=np.int64)
        heading = _smooth(t_ns, np.array([b.heading_rad for b in beams]))
        reference = float(heading.mean())
        depths = self._depths.within(int(t_ns[0]), int(t_ns[-1]))
        depth = self._depths.at(int(t_ns[-1])) if len(self._depths) else math.nan
        scan = Scan(
            index=self._count,
            t_start_ns=int(t_ns[0]),
            t_end_ns=int(t_ns[-1]),
            heading_rad=reference % TURN,
            depth_m=float(np.median(depths)) if len(depths) else depth,
            bearing_rad=np.array([b.ping.bearing_rad for b in beams]) + heading - reference,
            echoes=np.stack([b.ping.echoes for b in beams]),
            bin_m=beams[0].ping.bin_m,
            step_rad=_step(beams),
            quality=quality,
        )
        self._count += 1
        return [scan]

    def _trim(self) -> None:
        """Forget what lies more than two turns or two sweeps back."""
        last = self._beams[-1]
        far = KEEP_TURNS * TURN
        kept = [i for i, b in enumerate(self._beams) if b.leg >= last.leg - 1 and abs(b.turn_rad - last.turn_rad) < far]
        first = max(kept[0], len(self._beams) - MAX_PINGS)
        if first < 64:
            return
        del self._beams[:first]
        self._run = [(i - first, j - first) for i, j in self._run if j >= first]


def _same_settings(a: Ping, b: Ping) -> bool:
    return (a.bin_m, len(a.echoes), a.head.step_rad) == (b.bin_m, len(b.echoes), b.head.step_rad)


def _step(beams: list[_Beam]) -> float:
    """Angle between neighbouring beams: what they were, else what the head was told."""
    moved = np.abs(np.diff([b.turn_rad for b in beams]))
    moved = moved[moved > 1e-6]
    return float(np.median(moved)) if len(moved) else beams[0].ping.head.step_rad


def _smooth(t_ns: NDArray[np.int64], heading_rad: NDArray[np.float64]) -> NDArray[np.float64]:
    """Average the heading over half a second to either side: a compass trembles more than a vehicle at rest."""
    total = np.concatenate(([0.0], np.cumsum(heading_rad)))
    first = np.searchsorted(t_ns, t_ns - 500_000_000, side="left")
    last = np.searchsorted(t_ns, t_ns + 500_000_000, side="right")
    return np.asarray((total[last] - total[first]) / (last - first), dtype=np.float64)
