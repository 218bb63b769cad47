"""From what the device on a feed's line says to readings: whatever the device, the same corrections in one place.

A magnetic heading becomes one from true north: deviation of the compass, then the variation that the same feed tells
in HDG or else the site's declination: one of the two, once.  A device that says its heading is true is taken at its
word.  A pressure becomes a depth (`drivers.hydrostatics`).
"""

from __future__ import annotations

import math
import statistics
from collections import deque
from collections.abc import Iterator
from typing import Final

from config.schema import Feed, Site
from drivers.counters import Counters
from drivers.deviation import Deviation
from drivers.hydrostatics import Surface, depth_m, surface_of
from drivers.odometry import Odometer
from drivers.quality import GOOD, JumpGate, Opinion, worst
from drivers.readings import Altitude, Depth, Heading, Odometry, Reading
from drivers.statements import AnyStatement, Located, Meaning, Message, Moved, Reader, Statement

_TURN_SLACK_DEG: Final = 15.0
"""Sentences that a network delivers together have one date, and a turning vehicle some degrees between them."""
_DIVE_SLACK_M: Final = 0.5
_CLIMB_SLACK_M: Final = 1.0
"""Steps and boulders pass below a vehicle at once."""
_LEAST_MBAR: Final = 500.0
_DEEPEST_M: Final = 12_000.0
_TARE_NS: Final = 5_000_000_000
_TARE_READINGS: Final = 3


class FeedDecoder:
    """Readings of one feed, of the quantities that it provides; each is dated at the first byte of its message."""

    def __init__(self, feed: Feed, site: Site, reader: Reader) -> None:
        self._feed = feed
        self._site = site
        self._reader = reader
        self._variation_deg = site.declination_deg
        self._deviation = Deviation(feed.deviation_deg)
        self._surface = surface_of(feed.surface_mbar)
        self._pressures: deque[tuple[int, float]] = deque(maxlen=200)
        self._field = GOOD
        self.field_strength: float | None = None
        """Strength of the magnetic field as told last, in the compass's own unit; None where none is told."""
        self._turns = JumpGate(feed.max_turn_deg_s, _TURN_SLACK_DEG, "degrees", turn=360.0)
        self._dives = JumpGate(feed.max_dive_m_s, _DIVE_SLACK_M, "m")
        self._climbs = JumpGate(feed.max_climb_m_s, _CLIMB_SLACK_M, "m")
        self._odometer = Odometer(feed)
        self._latency_ns = round(feed.latency_ms * 1e6)

    @property
    def counters(self) -> Counters:
        """What the line's reader has seen so far."""
        return self._reader.counters

    @property
    def surface(self) -> Surface | None:
        """Pressure at the surface that depths are reckoned from; None while the feed has told no absolute pressure."""
        return self._surface if self._pressures else None

    def push(self, t_ns: int, data: bytes) -> list[Reading]:
        """Take bytes that arrived at ``t_ns`` and return the readings that they complete."""
        return [reading for message in self._reader.push(t_ns, data) for reading in self._readings(message)]

    def finish(self) -> list[Reading]:
        """End the stream, or note that the port was lost: the rest of a message is not joined with what comes."""
        return [reading for message in self._reader.finish() for reading in self._readings(message)]

    def surface_now(self, t_ns: int) -> float | None:
        """Return the median absolute pressure of the last 5 s, in mbar; None where less than 3 readings came."""
        recent = [mbar for at_ns, mbar in self._pressures if at_ns >= t_ns - _TARE_NS]
        return statistics.median(recent) if len(recent) >= _TARE_READINGS else None

    def tare(self, surface_mbar: float) -> None:
        """From now on reckon depths from this pressure at the surface."""
        self._surface = Surface(surface_mbar, "tare")

    def _readings(self, message: Message) -> Iterator[Reading]:
        for statement in message.statements:
            t_ns = message.t_ns - self._latency_ns
            reading = self._understood(t_ns, message.name, statement)
            if reading is not None:
                yield reading

    def _understood(self, t_ns: int, name: str, said: AnyStatement) -> Reading | None:
        return self._reading(t_ns, name, said) if isinstance(said, Statement) else self._way(t_ns, name, said)

    def _way(self, t_ns: int, name: str, said: Moved | Located) -> Odometry | None:
        if "odometry" not in self._feed.provides:
            return None
        if isinstance(said, Moved):
            return self._odometer.moved(t_ns, self._source(name), said)
        is_true = self._feed.heading_reference == "true"
        return self._odometer.located(t_ns, self._source(name), said, 0.0 if is_true else self._variation_deg)

    def _reading(self, t_ns: int, name: str, said: Statement) -> Reading | None:
        match said.what:
            case Meaning.VARIATION:
                if self._feed.variation == "sentence":
                    self._variation_deg = said.value
            case Meaning.FIELD:
                self.field_strength = said.value
                self._field = self._field_opinion(said.value)
            case Meaning.MAGNETIC | Meaning.TRUE:
                return self._heading(t_ns, name, said)
            case Meaning.ABSOLUTE | Meaning.GAUGE | Meaning.PRESSURE:
                return self._depth_of_pressure(t_ns, name, said)
            case what if what in self._depths():
                return self._depth(t_ns, name, said.value, _opinion(said))
            case what if what in self._altitudes():
                return self._altitude(t_ns, name, said)
        return None

    def _heading(self, t_ns: int, name: str, said: Statement) -> Heading | None:
        if "heading" not in self._feed.provides:
            return None
        opinion = worst(_opinion(said), self._field)
        if opinion.quality != "bad":
            opinion = worst(opinion, self._turns.judge(name, t_ns, said.value))
        told = "magnetic" if said.what is Meaning.MAGNETIC else "true"
        reference = told if self._feed.heading_reference == "as_said" else self._feed.heading_reference
        heading_deg = said.value - self._feed.mount_deg
        if reference == "magnetic":
            heading_deg += self._deviation.at(said.value) + self._variation_deg
        heading_rad = math.radians(heading_deg % 360.0) % math.tau
        return Heading(t_ns, heading_rad, self._source(name), opinion.quality, opinion.reason)

    def _depth_of_pressure(self, t_ns: int, name: str, said: Statement) -> Depth | None:
        if "depth" not in self._feed.provides:
            return None
        opinion = _opinion(said)
        if said.what is Meaning.GAUGE or (said.what is Meaning.PRESSURE and self._feed.pressure == "gauge"):
            return self._depth(t_ns, name, depth_m(said.value, self._site), opinion)
        if said.value < _LEAST_MBAR:
            opinion = worst(opinion, Opinion("bad", f"{said.value:.0f} mbar is less than any air: no pressure sensor?"))
        elif opinion.quality != "bad":
            self._pressures.append((t_ns, said.value))
        if self._surface.origin == "assumed":
            opinion = worst(opinion, Opinion("suspect", f"surface pressure assumed {self._surface.mbar:g} mbar: tare"))
        return self._depth(t_ns, name, depth_m(said.value - self._surface.mbar, self._site), opinion)

    def _depth(self, t_ns: int, name: str, value_m: float, opinion: Opinion) -> Depth | None:
        if "depth" not in self._feed.provides:
            return None
        value_m += self._feed.depth_offset_m
        if abs(value_m) > _DEEPEST_M:
            opinion = worst(Opinion("bad", f"a depth of {value_m:.0f} m is not possible"), opinion)
        elif opinion.quality != "bad":
            opinion = worst(opinion, self._dives.judge(f"{name} depth", t_ns, value_m))
        return Depth(t_ns, value_m, self._source(name), opinion.quality, opinion.reason)

    def _altitude(self, t_ns: int, name: str, said: Statement) -> Altitude | None:
        if "altitude" not in self._feed.provides:
            return None
        opinion = _opinion(said)
        if opinion.quality != "bad":
            opinion = worst(opinion, self._climbs.judge(name, t_ns, said.value))
        return Altitude(t_ns, said.value, self._source(name), opinion.quality, opinion.reason)

    def _field_opinion(self, strength: float) -> Opinion:
        right = self._feed.field_strength
        if right is None or abs(strength / right - 1.0) * 100.0 <= self._feed.field_tolerance_pct:
            return GOOD
        return Opinion("suspect", f"magnetic field {strength:g}, undisturbed {right:g}")

    def _source(self, name: str) -> str:
        return f"{self._feed.name}:{name}"

    def _depths(self) -> tuple[Meaning, ...]:
        return (Meaning.DEPTH, Meaning.BELOW_SURFACE) if self._feed.dpt == "vehicle_depth" else (Meaning.DEPTH,)

    def _altitudes(self) -> tuple[Meaning, ...]:
        return (Meaning.ALTITUDE, Meaning.ABOVE_FLOOR) if self._feed.dpt == "altitude" else (Meaning.ALTITUDE,)


def _opinion(said: Statement) -> Opinion:
    return Opinion(said.quality, said.reason)
