"""The emulated vehicle: rests at a stop, moves to the next one, and remembers where it truly was."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from math import atan2, cos, hypot, pi, sin, tau
from typing import Final

from tools.emulator.echoes import Place
from tools.emulator.site import Stop

SECOND_NS: Final = 1_000_000_000
MOST_DRIFT_M: Final = 0.2
_MOST_CREEP_M: Final = 0.4
_GOLDEN_RAD: Final = 2.4
_LEAST_MOVE_S: Final = 2.0


@dataclass(frozen=True, slots=True)
class VehicleOptions:
    """How the vehicle moves and rests.

    A rest ends after ``rest_s`` and ``circles`` full circles of the sonar, after ``rest_pings`` pings where that is
    given, and after ``longest_rest_s`` at the latest.  ``sway_m``, ``heave_m`` (depth) and ``wobble_rad`` (heading) are
    the standard deviations of slow wander.  At rest the vehicle moreover drifts by ``drift_m_s`` in a direction that
    differs from stop to stop, ``MOST_DRIFT_M`` at most, and creeps by ``creep_m_s`` towards the next stop.
    """

    speed_m_s: float = 0.4
    turn_rad_s: float = 0.5
    rest_s: float = 14.0
    rest_pings: int | None = None
    circles: float = 1.4
    longest_rest_s: float = 90.0
    sway_m: float = 0.003
    heave_m: float = 0.003
    wobble_rad: float = 0.004
    drift_m_s: float = 0.0
    creep_m_s: float = 0.0


PILOTS: Final[dict[str, VehicleOptions]] = {
    "steady": VehicleOptions(),
    "restless": VehicleOptions(sway_m=0.025, heave_m=0.04, wobble_rad=0.03),
    "hasty": VehicleOptions(speed_m_s=0.6, rest_s=0.0, circles=1.05, sway_m=0.008, wobble_rad=0.01, creep_m_s=0.025),
}
"""One who rests, one who never quite does (centimetres and degrees), one who creeps on and leaves after one circle."""


@dataclass(frozen=True, slots=True)
class Rest:
    """A rest; ``to_ns`` is None until it was long enough."""

    index: int
    stop: Stop
    from_ns: int
    to_ns: int | None


@dataclass(frozen=True, slots=True)
class _Leg:
    """A way under way: since when, from where, and the points of the path."""

    left_ns: int
    start: Place
    path_m: list[tuple[float, float]]


class Vehicle:
    """Stops in order.  ``start`` begins the dive; ``advance`` ends rests; after the last stop it stays at rest."""

    def __init__(self, stops: tuple[Stop, ...], options: VehicleOptions, phase: float = 0.0) -> None:
        self.rests: list[Rest] = []
        self.done = False
        self._stops = stops
        self._options = options
        self._phase = phase
        self._index = 0
        self._arrive_ns = 0
        self._leg: _Leg | None = None
        self._swept_before = 0.0
        self._pings_before = 0

    @property
    def index(self) -> int:
        """Number of the stop at which the vehicle is, or to which it moves."""
        return self._index

    @property
    def started(self) -> bool:
        """Whether the dive has begun."""
        return bool(self.rests)

    def start(self, t_ns: int) -> None:
        """Begin the first rest now."""
        if not self.started:
            self._arrive_ns = t_ns
            self.rests.append(Rest(0, self._stops[0], t_ns, None))

    def advance(self, t_ns: int, pings: int, swept_rad: float) -> bool:
        """Arrive or leave where it is time to; return whether a rest began or the last one was long enough.

        ``pings`` and ``swept_rad`` count all that the sonar has done so far.
        """
        if not self.started or self.done or t_ns < self._arrive_ns:
            return False
        if len(self.rests) <= self._index:
            self.rests.append(Rest(self._index, self._stops[self._index], self._arrive_ns, None))
            self._pings_before, self._swept_before = pings, swept_rad
            return True
        if not self._rested(t_ns, pings, swept_rad):
            return False
        rest = self.rests[-1]
        self.rests[-1] = Rest(rest.index, rest.stop, rest.from_ns, t_ns)
        if self._index + 1 == len(self._stops):
            self.done = True
            return True
        self._leave(t_ns)
        return False

    def place_at(self, t_ns: int) -> Place:
        """Where the vehicle is; only for times since the last departure."""
        if self._leg is not None and t_ns < self._arrive_ns:
            return self._wander(t_ns, self._under_way(t_ns, self._leg))
        return self._wander(t_ns, self._at_rest(t_ns))

    def _rested(self, t_ns: int, pings: int, swept_rad: float) -> bool:
        options = self._options
        rest_s = (t_ns - self._arrive_ns) / SECOND_NS
        if options.rest_pings is not None:
            return pings - self._pings_before >= options.rest_pings
        circled = swept_rad - self._swept_before >= options.circles * tau
        return rest_s >= options.longest_rest_s or (circled and rest_s >= options.rest_s)

    def _leave(self, t_ns: int) -> None:
        start = self._at_rest(t_ns)
        self._index += 1
        there = self._stops[self._index]
        path = [(start.x_m, start.y_m), *there.via_m, (there.x_m, there.y_m)]
        turn = abs(_turn(start.heading_rad, there.heading_rad))
        # A smooth start and stop takes 15/8 of the time at the greatest speed.
        seconds = 1.875 * max(_length(path) / self._options.speed_m_s, turn / self._options.turn_rad_s)
        self._leg = _Leg(t_ns, start, path)
        self._arrive_ns = t_ns + int(max(seconds, _LEAST_MOVE_S) * SECOND_NS)

    def _under_way(self, t_ns: int, leg: _Leg) -> Place:
        share = max(0.0, (t_ns - leg.left_ns) / (self._arrive_ns - leg.left_ns))
        share = share**3 * (10.0 - 15.0 * share + 6.0 * share**2)
        start, there = leg.start, self._stops[self._index]
        x_m, y_m = _along(leg.path_m, share * _length(leg.path_m))
        heading = start.heading_rad + share * _turn(start.heading_rad, there.heading_rad)
        return Place(x_m, y_m, start.depth_m + share * (there.depth_m - start.depth_m), heading)

    def _at_rest(self, t_ns: int) -> Place:
        """Return the stop, and how far the vehicle has slipped from it meanwhile."""
        here, after = self._stops[self._index], self._stops[self._index + 1 : self._index + 2]
        rest_s = max(0.0, (t_ns - self._arrive_ns) / SECOND_NS) if self.started else 0.0
        x_m, y_m = here.x_m, here.y_m
        if self._options.creep_m_s and after:
            path = [(x_m, y_m), *after[0].via_m, (after[0].x_m, after[0].y_m)]
            x_m, y_m = _along(path, min(self._options.creep_m_s * rest_s, _MOST_CREEP_M))
        slip_m = min(self._options.drift_m_s * rest_s, MOST_DRIFT_M)
        towards = self._phase + _GOLDEN_RAD * self._index
        return Place(x_m + slip_m * sin(towards), y_m + slip_m * cos(towards), here.depth_m, here.heading_rad)

    def _wander(self, t_ns: int, place: Place) -> Place:
        options, t_s = self._options, t_ns / SECOND_NS
        return Place(
            place.x_m + options.sway_m * sway(self._phase, t_s),
            place.y_m + options.sway_m * sway(self._phase + 1.7, t_s),
            place.depth_m + options.heave_m * sway(self._phase + 3.1, t_s),
            (place.heading_rad + options.wobble_rad * sway(self._phase + 4.4, t_s)) % tau,
        )


def sway(phase: float, t_s: float) -> float:
    """Return a slow wander of zero mean and unit deviation, made of three sines that never repeat together."""
    slow, middle, quick = 0.31 * t_s + phase, 0.83 * t_s + 2.1 * phase, 1.9 * t_s + 3.7 * phase
    return 1.155 * sin(slow) + 0.73 * sin(middle) + 0.37 * cos(quick)


def _turn(start_rad: float, end_rad: float) -> float:
    """Shortest turn from one heading to another."""
    change = (end_rad - start_rad + pi) % tau
    return change - pi


def _length(way: list[tuple[float, float]]) -> float:
    return sum(hypot(b[0] - a[0], b[1] - a[1]) for a, b in pairwise(way))


def _along(way: list[tuple[float, float]], distance_m: float) -> tuple[float, float]:
    """Point of a path at a distance from its beginning."""
    for a, b in pairwise(way):
        leg = hypot(b[0] - a[0], b[1] - a[1])
        if distance_m <= leg and leg > 0.0:
            course = atan2(b[0] - a[0], b[1] - a[1])
            return a[0] + distance_m * sin(course), a[1] + distance_m * cos(course)
        distance_m -= leg
    return way[-1]
