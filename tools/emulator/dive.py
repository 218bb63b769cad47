"""A dive without clocks or ports: vehicle, head, feed and echoes, moved on by the times that it is given."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from math import tau
from typing import Final

import numpy as np
from numpy.typing import NDArray

from drivers.tritech.headdata import HeadStatus
from drivers.tritech.units import TURN
from tools.emulator.echoes import EchoModel, Place, Sampling
from tools.emulator.faults.calendar import Calendar, Spell
from tools.emulator.faults.line import FaultyLine
from tools.emulator.faults.script import Fault, Port
from tools.emulator.faults.senses import Senses
from tools.emulator.feeds import FeedOptions, NmeaFeed
from tools.emulator.head import Head, HeadOptions, Sounding
from tools.emulator.line import Line
from tools.emulator.site import Site
from tools.emulator.vehicle import Rest, Vehicle, VehicleOptions

SECOND_NS: Final = 1_000_000_000
TRACK_NS: Final = 100_000_000


@dataclass(frozen=True, slots=True)
class DiveOptions:
    """What may differ from dive to dive.

    ``stations`` limits the stops; ``sound_speed_m_s`` is the water's own.  ``mount_rad`` is the head's ahead,
    clockwise from the bow; a head that hangs upside down turns the other way.  ``faults`` come by the dive's seed.
    """

    stations: int | None = None
    sound_speed_m_s: float = 1481.0
    mount_rad: float = 0.0
    upside_down: bool = False
    head: HeadOptions = field(default_factory=HeadOptions)
    feed: FeedOptions = field(default_factory=FeedOptions)
    vehicle: VehicleOptions = field(default_factory=VehicleOptions)
    faults: tuple[Fault, ...] = ()


@dataclass(frozen=True, slots=True)
class Track:
    """A place of the true trajectory."""

    t_ns: int
    place: Place


class Dive:
    """The emulated vehicle: bytes of the host in, bytes of both lines out; never looks at a clock.

    The vehicle rests at its first stop until the host asks for data, so that a slow start loses nothing.
    """

    def __init__(self, site: Site, seed: int, options: DiveOptions | None = None) -> None:
        self.options = options or DiveOptions()
        self.site = replace(site, stops=site.stops[: self.options.stations])
        self.seed = seed
        self.track: list[Track] = []
        rng = np.random.default_rng((seed, 0xD1FE))
        self.vehicle = Vehicle(self.site.stops, self.options.vehicle, phase=float(rng.uniform(0.0, tau)))
        self.calendar = Calendar(self.options.faults, seed)
        self.spells: list[Spell] = []
        bauds: dict[Port, int] = {"sonar": self.options.head.baud, "feed": self.options.feed.baud}
        self._lines = {port: FaultyLine(Line(baud), seed + baud) for port, baud in bauds.items()}
        self._senses = Senses(self.vehicle.place_at)
        self.head = Head(self._listen, self.options.head, 0, self._lines["sonar"], self._echosounder)
        self._echoes = EchoModel(self.site, seed)
        senses = self._senses
        self._feed = NmeaFeed(senses.place_at, rng, self.options.feed, self._lines["feed"], senses.is_stuck)
        self._swept = 0.0
        self._next_track_ns = 0

    @property
    def done(self) -> bool:
        """Whether the last stop's rest was long enough."""
        return self.vehicle.done

    @property
    def rests(self) -> list[Rest]:
        """The rests so far, in order."""
        return self.vehicle.rests

    def place_during(self, rest: Rest) -> Place:
        """Return where the vehicle truly was at a rest, on average; the stop itself where nothing is known yet."""
        until_ns = rest.to_ns if rest.to_ns is not None else rest.from_ns
        places = [each.place for each in self.track if rest.from_ns <= each.t_ns <= until_ns]
        if not places:
            return Place(rest.stop.x_m, rest.stop.y_m, rest.stop.depth_m, rest.stop.heading_rad)
        rows = np.array([(each.x_m, each.y_m, each.depth_m) for each in places])
        headings = np.array([each.heading_rad for each in places])
        heading_rad = float(np.arctan2(np.sin(headings).mean(), np.cos(headings).mean()) % tau)
        x_m, y_m, depth_m = (float(column) for column in rows.mean(axis=0))
        return Place(x_m, y_m, depth_m, heading_rad)

    def push(self, t_ns: int, data: bytes) -> None:
        """Take bytes that the host sent to the sonar."""
        self.calendar.start(t_ns)
        self.head.push(t_ns, self._lines["sonar"].hear(t_ns, data))

    def is_hung_up(self, port: Port, t_ns: int) -> bool:
        """Whether a port is gone now, as if unplugged."""
        return self._lines[port].is_hung_up(t_ns)

    def tick(self, t_ns: int) -> tuple[bytes, bytes]:
        """Move on to ``t_ns`` and return what the sonar's and the feed's lines have delivered since the last call."""
        for spell in self.calendar.advance(t_ns):
            self.spells.append(spell)
            self._befall(t_ns, spell)
        sonar = self.head.tick(t_ns)
        feed = self._feed.tick(t_ns)
        if self.vehicle.started and t_ns >= self._next_track_ns:
            self.track.append(Track(t_ns, self.vehicle.place_at(t_ns)))
            self._next_track_ns = t_ns + TRACK_NS
        return sonar, feed

    def advance(self, t_ns: int) -> bool:
        """Let the vehicle start, leave or arrive; return whether a rest began or the dive is done."""
        if not self.vehicle.started and self.head.pings:
            self.vehicle.start(t_ns)
            return True
        return self.vehicle.advance(t_ns, self.head.pings, self._swept)

    def _listen(self, sounding: Sounding) -> NDArray[np.uint8]:
        place = self.vehicle.place_at(sounding.t_ns)
        bin_m = self.options.sound_speed_m_s * sounding.interval_ns * 1e-9 / 2.0
        settings = self.head.settings
        self._swept += (settings.step if settings else 0) * tau / TURN
        sampling = Sampling(bin_m, sounding.bins, sounding.gain_db)
        turned = -sounding.bearing_rad if self.options.upside_down else sounding.bearing_rad
        return self._echoes.ping(place, self.options.mount_rad + turned, sampling, self.head.pings)

    def _befall(self, t_ns: int, spell: Spell) -> None:
        fault = spell.fault
        match fault.kind:
            case "power_cut":
                self.head.cut_power(t_ns, spell.to_ns)
            case "power_loss":
                self.head.fail(HeadStatus.POWER_LOST)
            case "motor_error":
                self.head.fail(HeadStatus.MOTOR_ERROR, round(fault.turn_deg * TURN / 360.0))
            case "stale" | "jump":
                self._senses.begin(spell)
            case _ if fault.befalls:
                self._lines[fault.befalls].begin(t_ns, spell)

    def _echosounder(self, t_ns: int) -> bytes:
        """Return what an echosounder on the head's auxiliary port says: the height above the floor."""
        return f"{max(0.0, self.site.floor_m - self.vehicle.place_at(t_ns).depth_m):.3f}m\r\n".encode()
