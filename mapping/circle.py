"""The full circle at rest, found among the beams: without odometry, by what the echoes, heading and depth say.

A circle is given where enough of a new turn agrees with the turn before.  One rest gives one circle, however long it
lasts: a vehicle that does not move sees the same speckle again, and seeing it twice proves nothing.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from mapping.agreeing import GRAIN_BEAMS, Agreeing, Pair
from mapping.rest import FROZEN, SECTOR_BEAMS, Agreement, common_to_all, compare, frozen, grain_of, still
from mapping.turns import TURN, Beam, longest_leg, partner, steady_headings, step_of, swept_rad

CONFIRM_RAD = math.radians(120.0)
"""A circle is believed when this much of the next turn agrees with it: who drives along a wall sees that one wall
unchanged, but hardly over more than this."""
CONFIRM_LEFT_RAD = math.radians(80.0)
"""... or this much, where the vehicle then leaves and its heading was steady."""
CONFIRM_END_RAD = math.radians(30.0)  # ... or this much, where the log ends
LOOSE_PINGS = 600  # ... and so many on end where the walls agree and their grain, frozen at an earlier rest, does not
STEADY_RAD = math.radians(12.0)  # the heading's range within a circle at rest and the beams that confirm it
STEADY_LATE_RAD = math.radians(4.0)
SWEEP_SHARE = 0.75  # of a sector, which the sweep back confirms
UNSTEADY_PINGS = 10  # beams on end that disagree: the vehicle moves
LEFT_OF, LEFT_SHARE = 100, 0.5  # a rest is over when so many of the last beams disagree
RACE_RAD_S = math.radians(8.0)
DEPTH_STEP_M = 0.4
COMMON_PINGS, COMMON_OF = 16, 256
"""What is common to all bearings is found anew every so many pings, from so many."""
GRAINY = 0.75  # median correlation of the grain at a rest from which its loss tells motion in this dive
KEEP_TURNS = 2.2
MAX_PINGS = 8192  # bound of the buffer when the head does not turn
TRIM_PINGS = 64

Quality = Literal["full", "partial", "moving"]


@dataclass(frozen=True, slots=True)
class Circle:
    """Beams of one circle, or of one sweep over a sector, from one place."""

    beams: list[Beam]
    quality: Quality


class CircleFinder:
    """Takes the beams of one setting one by one; gives each circle at rest once."""

    def __init__(self, min_range_m: float, *, grainy: bool = False) -> None:
        self._min_range_m = min_range_m
        self._grainy = grainy
        self._beams: list[Beam] = []
        self._recent: list[Agreement] = []
        self._agreeing = Agreeing()
        self._frozen = 0  # beams on end whose grain is frozen
        self._still_frozen = False  # whether grain tells the end of this rest
        self._doubted = False  # whether grain spoke of motion when its circle was given
        self._common_profile = np.zeros(0)
        self._common_age = 0
        self._verdicts: list[bool] = []
        self._unsteady = 0
        self._resting = self._moved = False

    @property
    def beams(self) -> list[Beam]:
        """The beams of the last two turns."""
        return self._beams

    @property
    def resting(self) -> bool:
        """Whether the vehicle is at the rest whose circle was given."""
        return self._resting

    @property
    def grainy(self) -> bool:
        """Whether speckle was frozen at a rest of this dive."""
        return self._grainy

    def push(self, beam: Beam) -> Circle | None:
        """Take the next beam; give the circle that it completes."""
        self._beams.append(beam)
        earlier = partner(self._beams)
        found = None if earlier is None else self._judge(self._beams[earlier])
        self._trim()
        return found

    def close(self) -> Circle | None:
        """Give what is still open at the end of a log or of a setting."""
        if self._confirmed_late(CONFIRM_END_RAD):
            return self._found(0.5)
        if self._resting or self._moved or not self._beams:
            return None
        beams = longest_leg(self._beams)
        whole = abs(beams[-1].turn_rad - beams[0].turn_rad) >= TURN - 1.5 * step_of(beams)
        return Circle(beams, "full" if whole else "partial")

    def _judge(self, before: Beam) -> Circle | None:
        now = self._beams[-1]
        products = grain_of(now.ping.echoes, before.ping.echoes, now.ping.bin_m, self._min_range_m)
        self._recent.append(compare(now.profile, before.profile, self._common(), now.ping.bin_m, products))
        del self._recent[:-COMMON_OF]
        verdict = still(self._recent[-SECTOR_BEAMS:], float(np.median([a.energy for a in self._recent])))
        if races(now, before):
            verdict = False
        if verdict is None:
            return None
        grain = frozen(self._recent[-SECTOR_BEAMS:])
        if self._still_frozen and grain < FROZEN:
            verdict = False
        self._frozen = self._frozen + 1 if grain >= FROZEN else 0
        self._verdicts.append(verdict)
        del self._verdicts[:-LEFT_OF]
        if self._resting:
            self._watch()
            return None
        return self._agree(Pair(now, before, grain)) if verdict else self._disagree()

    def _watch(self) -> None:
        """Watch for the end of a rest whose circle was given, or for its true begin where that was given under way."""
        settled = self._grainy and not self._still_frozen and self._frozen >= GRAIN_BEAMS
        self._still_frozen |= settled
        if (settled and self._doubted) or self._verdicts.count(False) >= LEFT_SHARE * LEFT_OF:
            self._resting, self._moved, self._unsteady, self._still_frozen = False, True, 0, False
            self._agreeing.clear()

    def _agree(self, pair: Pair) -> Circle | None:
        self._unsteady = 0
        if pair.grain >= FROZEN and self._is_loose():
            self._agreeing.clear()  # the end of a drive along smooth walls
        self._agreeing.add(pair, STEADY_RAD)
        if self._agreeing.turned_rad < self._needed_rad() or self._swing_rad() > STEADY_RAD:
            return None
        return self._found(1.0)

    def _disagree(self) -> Circle | None:
        self._unsteady += 1
        if self._unsteady < UNSTEADY_PINGS:
            return None
        found = self._found(0.5) if self._confirmed_late(CONFIRM_LEFT_RAD) else None
        self._moved = True
        self._agreeing.end()
        return found

    def _common(self) -> NDArray[np.float64]:
        """Give what all bearings of the last turn show, renewed now and then."""
        if self._common_age % COMMON_PINGS == 0:
            self._common_profile = common_to_all([b.profile for b in self._beams[-COMMON_OF:]])
        self._common_age += 1
        return self._common_profile

    def _is_loose(self) -> bool:
        """Whether the grain of the beams that agree speaks of motion."""
        return self._grainy and self._agreeing.grain < FROZEN

    def _confirmed_late(self, needed_rad: float) -> bool:
        if self._resting or self._agreeing.turned_rad < needed_rad or self._sweeping() or self._is_loose():
            return False
        return self._swing_rad() <= STEADY_LATE_RAD

    def _swing_rad(self) -> float:
        """Range of the heading over the circle and the beams that confirm it."""
        first, last = self._agreeing.span
        return float(np.ptp(steady_headings(self._between(first, last + 1))))

    def _between(self, first: int, end: int) -> list[Beam]:
        """Give the beams from one number up to another."""
        origin = self._beams[0].number
        return self._beams[first - origin : end - origin]

    def _sweeping(self) -> bool:
        return self._beams[-1].leg != self._beams[0].leg

    def _needed_rad(self) -> float:
        if not self._sweeping():
            return math.inf if self._is_loose() and self._agreeing.loose < LOOSE_PINGS else CONFIRM_RAD
        return max(CONFIRM_RAD, SWEEP_SHARE * swept_rad(self._beams, self._agreeing.at(1.0).before.leg))

    def _found(self, settled: float) -> Circle:
        """Give a circle of those that agree, or the sweep that was confirmed.

        ``settled`` chooses the circle, 0 the first, 1 the last: the first ones may hold the end of the drift in, the
        last ones the beginning of the way out.
        """
        chosen, last = self._agreeing.at(settled), self._agreeing.at(1.0)
        self._verdicts.clear()
        self._doubted = self._is_loose()
        self._still_frozen = self._agreeing.grain > GRAINY and not math.isnan(last.grain)
        self._grainy |= self._still_frozen
        self._resting = True
        if self._sweeping():
            return Circle([b for b in self._beams if b.leg == last.before.leg], "partial")
        return Circle(self._between(chosen.before.number, chosen.now.number), "full")

    def _trim(self) -> None:
        """Forget what lies more than two turns or two sweeps back."""
        last, far = self._beams[-1], KEEP_TURNS * TURN
        kept = [i for i, b in enumerate(self._beams) if b.leg >= last.leg - 1 and abs(b.turn_rad - last.turn_rad) < far]
        first = max(kept[0], len(self._beams) - MAX_PINGS)
        if first < TRIM_PINGS:
            return
        del self._beams[:first]
        self._agreeing.forget_before(self._beams[0].number)


def races(now: Beam, before: Beam) -> bool:
    """Whether heading or depth alone tell a move between two beams in the same direction."""
    turned = abs(now.heading_rad - before.heading_rad) > STEADY_RAD
    sank = abs(now.attitude.depth_m - before.attitude.depth_m) > DEPTH_STEP_M
    return turned or abs(now.attitude.rate_rad_s) > RACE_RAD_S or sank
