"""From readings to stationary scans: a full circle at rest is found by itself, without odometry.

The vehicle is at rest where the beams of a new turn see what the turn before saw (``mapping.rest``), the heading does
not race and the depth holds.  One rest gives one scan, however long it lasts: a vehicle that does not move sees the
same speckle again, and seeing it twice proves nothing.
"""

from __future__ import annotations

import math
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from config.schema import Map
from drivers.readings import Altitude, Depth, Heading, Odometry, Ping, Reading
from mapping.compass import Track
from mapping.odometry import Odometer
from mapping.passage import Passage
from mapping.rest import FROZEN, SECTOR_BEAMS, Agreement, common_to_all, compare, frozen, grain_of, profile, still
from mapping.turns import (
    TURN,
    Beam,
    longest_leg,
    next_beam,
    partner,
    same_settings,
    steady_headings,
    step_of,
    swept_rad,
)
from mapping.values import Scan

HOLD_NS = 1_000_000_000  # a ping waits this long for a heading at or after it
CONFIRM_RAD = math.radians(120.0)
"""A circle is believed when this much of the next turn agrees with it: who drives along a wall sees that one wall
unchanged, but hardly over more than this."""
CONFIRM_LEFT_RAD = math.radians(80.0)
"""... or this much, where the vehicle then leaves and its heading was steady."""
CONFIRM_END_RAD = math.radians(30.0)  # ... or this much, where the log ends
LOOSE_PINGS = 600  # ... and so many on end where the walls agree and their grain, frozen at an earlier rest, does not
STEADY_RAD = math.radians(12.0)  # the heading's range within a circle at rest and the beams that confirm it
STEADY_LATE_RAD = math.radians(4.0)
SWEEP_SHARE, PARTIAL_RAD = 0.75, math.radians(60.0)  # of a sector, which the sweep back confirms; less is no scan
UNSTEADY_PINGS = 10  # beams on end that disagree: the vehicle moves
LEFT_OF, LEFT_SHARE = 100, 0.5  # a rest is over when so many of the last beams disagree
RACE_RAD_S = math.radians(8.0)
DEPTH_STEP_M = 0.4
COMMON_PINGS, COMMON_OF = 16, 256
"""What is common to all bearings is found anew every so many pings, from so many."""
GRAINY = 0.75  # median correlation of the grain at a rest from which its loss tells motion in this dive
GRAIN_BEAMS = 64  # of those that agree, whose grain is asked for
KEEP_TURNS = 2.2
MAX_PINGS = 8192  # bound of the buffer when the head does not turn

Quality = Literal["full", "partial", "moving"]


class ScanBuilder:
    """Collects readings and gives each stationary circle (or sector sweep) once."""

    def __init__(self, config: Map) -> None:
        self._config = config
        self._headings = Track(angular=True)
        self._depths = Track(angular=False)
        self._held: list[Ping] = []
        self._count = 0
        self._passage = Passage()
        self._odometer = Odometer()
        self._grainy = False  # whether speckle was frozen at an earlier rest
        self._restart()

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
        scans += self._close()
        self._restart()
        return scans

    def _restart(self) -> None:
        self._beams: list[Beam] = []
        self._recent: list[Agreement] = []
        self._run: list[tuple[int, int, float]] = []  # steady beams, their partners (in _beams), and their grain
        self._frozen = 0  # beams on end whose grain is frozen
        self._still_frozen = False  # whether grain tells the end of this rest
        self._doubted = False  # whether grain spoke of motion when its scan was given
        self._common_profile = np.zeros(0)
        self._common_age = 0
        self._verdicts: list[bool] = []
        self._unsteady = 0
        self._resting = self._moved = False
        self._loose = 0  # beams on end that agree without their grain

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
        if self._beams and not same_settings(self._beams[-1].ping, ping):
            scans = self._close()
            self._restart()
            self._passage.lose()
        shape = profile(ping.echoes, ping.bin_m, self._config.min_range_m)
        self._beams.append(next_beam(self._beams, ping, self._heading(ping.t_ns), shape))
        self._passage.add(self._beams[-1], resting=self._resting)
        earlier = partner(self._beams)
        if earlier is not None:
            scans += self._judge(earlier)
        self._trim()
        return scans

    def _heading(self, t_ns: int) -> float:
        if len(self._headings):
            return self._headings.at(t_ns)
        return math.radians(self._config.heading_deg or 0.0)

    def _judge(self, earlier: int) -> list[Scan]:
        now, before = self._beams[-1], self._beams[earlier]
        products = grain_of(now.ping.echoes, before.ping.echoes, now.ping.bin_m, self._config.min_range_m)
        self._recent.append(compare(now.profile, before.profile, self._common(), now.ping.bin_m, products))
        del self._recent[:-COMMON_OF]
        verdict = still(self._recent[-SECTOR_BEAMS:], float(np.median([a.energy for a in self._recent])))
        if self._races(now, before):
            verdict = False
        if verdict is None:
            return []
        grain = frozen(self._recent[-SECTOR_BEAMS:])
        if self._still_frozen and grain < FROZEN:
            verdict = False
        self._frozen = self._frozen + 1 if grain >= FROZEN else 0
        self._verdicts.append(verdict)
        del self._verdicts[:-LEFT_OF]
        if self._resting:
            self._watch()
            return []
        return self._agree(earlier, grain) if verdict else self._disagree()

    def _watch(self) -> None:
        """Watch for the end of a rest whose scan was given, or for its true begin where that was given under way."""
        settled = self._grainy and not self._still_frozen and self._frozen >= GRAIN_BEAMS
        self._still_frozen |= settled
        if (settled and self._doubted) or self._verdicts.count(False) >= LEFT_SHARE * LEFT_OF:
            self._resting, self._moved, self._unsteady, self._still_frozen = False, True, 0, False
            self._run.clear()

    def _agree(self, earlier: int, grain: float) -> list[Scan]:
        self._unsteady = 0
        if grain >= FROZEN and self._is_loose():
            self._run.clear()  # the end of a drive along smooth walls
        self._loose = self._loose + 1 if grain < FROZEN else 0
        self._run.append((len(self._beams) - 1, earlier, grain))
        heading = self._beams[-1].heading_rad
        while abs(self._beams[self._run[0][1]].heading_rad - heading) > STEADY_RAD:
            del self._run[0]
        if self._agreed_rad() < self._needed_rad() or self._swing_rad() > STEADY_RAD:
            return []
        return self._emit(1.0)

    def _disagree(self) -> list[Scan]:
        self._unsteady += 1
        if self._unsteady < UNSTEADY_PINGS:
            return []
        scans = self._emit(0.5) if self._confirmed_late(CONFIRM_LEFT_RAD) else []
        self._moved, self._loose = True, 0
        self._run.clear()
        return scans

    def _common(self) -> NDArray[np.float64]:
        """Give what all bearings of the last turn show, renewed now and then."""
        if self._common_age % COMMON_PINGS == 0:
            self._common_profile = common_to_all([b.profile for b in self._beams[-COMMON_OF:]])
        self._common_age += 1
        return self._common_profile

    def _races(self, now: Beam, before: Beam) -> bool:
        """Whether heading or depth alone tell a move."""
        turned = abs(now.heading_rad - before.heading_rad) > STEADY_RAD
        if turned or abs(self._headings.rate(now.ping.t_ns)) > RACE_RAD_S:
            return True
        if len(self._depths) == 0:
            return False
        return abs(self._depths.at(now.ping.t_ns) - self._depths.at(before.ping.t_ns)) > DEPTH_STEP_M

    def _is_loose(self) -> bool:
        """Whether the grain of the beams that agree speaks of motion."""
        return self._grainy and self._grain() < FROZEN

    def _grain(self) -> float:
        """Median correlation of the grain over the beams that agree; 1 where nothing is told."""
        told = [grain for _, _, grain in self._run[-GRAIN_BEAMS:] if not math.isnan(grain)]
        return float(np.median(told)) if told else 1.0

    def _confirmed_late(self, needed_rad: float) -> bool:
        enough = self._agreed_rad() >= needed_rad and self._swing_rad() <= STEADY_LATE_RAD
        return enough and not self._resting and not self._sweeping() and not self._is_loose()

    def _agreed_rad(self) -> float:
        if not self._run:
            return 0.0
        return abs(self._beams[self._run[-1][0]].turn_rad - self._beams[self._run[0][0]].turn_rad)

    def _swing_rad(self) -> float:
        """Range of the heading over the circle and the beams that confirm it."""
        beams = self._beams[self._run[0][1] : self._run[-1][0] + 1]
        return float(np.ptp(steady_headings(beams)))

    def _sweeping(self) -> bool:
        return self._beams[-1].leg != self._beams[0].leg

    def _needed_rad(self) -> float:
        if not self._sweeping():
            return math.inf if self._is_loose() and self._loose < LOOSE_PINGS else CONFIRM_RAD
        return max(CONFIRM_RAD, SWEEP_SHARE * swept_rad(self._beams, self._beams[self._run[-1][1]].leg))

    def _emit(self, settled: float) -> list[Scan]:
        """Give a circle of those that agree, or the sweep that was confirmed.

        ``settled`` chooses the circle, 0 the first, 1 the last: the first ones may hold the end of the drift in, the
        last ones the beginning of the way out.
        """
        first, earlier, _ = self._run[int(settled * (len(self._run) - 1))]
        self._verdicts.clear()
        self._doubted = self._is_loose()
        self._still_frozen = self._grain() > GRAINY and not math.isnan(self._run[-1][2])
        self._grainy |= self._still_frozen
        leg = self._beams[self._run[-1][1]].leg
        self._resting = True
        if self._sweeping():
            return self._scan([b for b in self._beams if b.leg == leg], "partial")
        return self._scan(self._beams[earlier:first], "full")

    def _close(self) -> list[Scan]:
        """Give what the buffer holds at the end of a log or of a setting."""
        if self._confirmed_late(CONFIRM_END_RAD):
            return self._emit(0.5)
        if self._resting or self._moved or not self._beams:
            return []
        beams = longest_leg(self._beams)
        whole = abs(beams[-1].turn_rad - beams[0].turn_rad) >= TURN - 1.5 * step_of(beams)
        return self._scan(beams, "full" if whole else "partial")

    def _scan(self, beams: list[Beam], quality: Quality) -> list[Scan]:
        if not beams or abs(beams[-1].turn_rad - beams[0].turn_rad) < PARTIAL_RAD:
            return []
        start_ns, end_ns = beams[0].ping.t_ns, beams[-1].ping.t_ns
        reference = float((heading := steady_headings(beams)).mean())
        depths = self._depths.within(start_ns, end_ns)
        depth = self._depths.at(end_ns) if len(self._depths) else math.nan
        scan = Scan(
            index=self._count,
            t_start_ns=start_ns,
            t_end_ns=end_ns,
            heading_rad=reference % TURN,
            depth_m=float(np.median(depths)) if len(depths) else depth,
            bearing_rad=np.array([b.ping.bearing_rad for b in beams]) + heading - reference,
            echoes=np.stack([b.ping.echoes for b in beams]),
            bin_m=beams[0].ping.bin_m,
            step_rad=step_of(beams),
            quality=quality,
            way=self._passage.way_to(start_ns),
            has_compass=len(self._headings) > 0,
            moved=self._odometer.since_last((start_ns + end_ns) // 2),
        )
        self._passage.begin([b for b in self._beams if b.ping.t_ns > end_ns])
        self._count += 1
        return [scan]

    def _trim(self) -> None:
        """Forget what lies more than two turns or two sweeps back."""
        last, far = self._beams[-1], KEEP_TURNS * TURN
        kept = [i for i, b in enumerate(self._beams) if b.leg >= last.leg - 1 and abs(b.turn_rad - last.turn_rad) < far]
        first = max(kept[0], len(self._beams) - MAX_PINGS)
        if first < 64:
            return
        del self._beams[:first]
        self._run = [(i - first, j - first, grain) for i, j, grain in self._run if j >= first]
