"""From records to the beams that are published at once, without waiting for the map, and what the feeds say."""

from __future__ import annotations

from dataclasses import dataclass

from config.errors import DataError
from config.schema import Config, Feed
from daemon import snapshots
from daemon.snapshots import Snapshot
from drivers.counters import Counters
from drivers.decoders import SONAR_PORT, decoders_for
from drivers.feed import FeedDecoder
from drivers.quality import Tally
from drivers.readings import Depth, Heading, Ping, Reading, is_usable
from drivers.records import Chunk, Json
from drivers.tritech.decoder import TritechDecoder
from drivers.tritech.framing import Frame


@dataclass(frozen=True, slots=True)
class Tare:
    """What the operator took for the pressure at the surface, and what the feed's sensor said then, if it did."""

    port: str
    surface_mbar: float
    sensor_mbar: float | None


class Beams:
    """Decodes what came from the ports and remembers heading and depth, which a beam is shown with while fresh."""

    def __init__(self, config: Config) -> None:
        self._decoders = decoders_for(config)
        sonar = self._decoders[SONAR_PORT]
        self._sonar = sonar if isinstance(sonar, TritechDecoder) else None
        self._feeds = {feed.name: feed for feed in config.feed}
        self._tallies = {name: Tally() for name in self._feeds}
        self._told: dict[str, tuple[int, int]] = {}
        self._heading: tuple[Heading, Feed] | None = None
        self._depth: tuple[Depth, Feed] | None = None
        self.pings = 0
        """Beams decoded so far."""

    def push(self, chunk: Chunk) -> list[Snapshot]:
        """Return the beams that ``chunk`` completes."""
        decoder = self._decoders.get(chunk.port)
        if decoder is None or chunk.direction != "rx":
            return []
        return self._take(chunk.port, chunk.utc_ns, decoder.push(chunk.t_ns, chunk.data))

    def expire(self, t_ns: int, utc_ns: int) -> list[Snapshot]:
        """Return the beams that wait behind a frame of the sonar which can no longer end in time."""
        sonar = self._sonar
        return [] if sonar is None else self._take(SONAR_PORT, utc_ns, sonar.expire(t_ns))

    @property
    def frames(self) -> list[Frame]:
        """Frames of the sonar that the last ``push`` of its bytes, or ``expire``, completed: cut out once for all."""
        return [] if self._sonar is None else self._sonar.frames

    def _take(self, port: str, utc_ns: int, readings: list[Reading]) -> list[Snapshot]:
        told: list[Snapshot] = []
        for reading in readings:
            match reading:
                case Ping():
                    told.append(snapshots.ping(reading, utc_ns, *self._shown(reading.t_ns)))
                case _:
                    self._tallies[port].take(reading)
                    if isinstance(reading, Heading) and is_usable(reading):
                        self._heading = reading, self._feeds[port]
                    elif isinstance(reading, Depth) and is_usable(reading):
                        self._depth = reading, self._feeds[port]
        self.pings += len(told)
        return told

    def interrupt(self, port: str) -> None:
        """Note that a port was lost: what comes next is not the rest of what came."""
        self._decoders[port].finish()

    def counters(self, port: str) -> Counters:
        """Return what the decoder of ``port`` has seen."""
        return self._decoders[port].counters

    def tare_of(self, t_ns: int, port: str | None, surface_mbar: float | None) -> Tare:
        """Return a tare: of which feed, and the surface pressure, as told or as heard in the last seconds.

        Raises DataError where there is no such feed, no pressure, or more than one feed that it could be.
        """
        heard = {name: self._surface_now(name, t_ns) for name in self._feeds if port in (None, name)}
        named = {name: mbar if surface_mbar is None else surface_mbar for name, mbar in heard.items()}
        known = {name: mbar for name, mbar in named.items() if mbar is not None}
        if port is None and surface_mbar is not None and len(known) > 1:
            known = {name: mbar for name, mbar in known.items() if heard[name] is not None}
        if len(known) != 1:
            what = "no feed told" if not known else f"the feeds {', '.join(known)} told"
            raise DataError(f"{what} an absolute pressure in the last 5 s; name the feed as 'port', see health")
        ((name, mbar),) = known.items()
        sensor = heard[name]
        return Tare(name, round(mbar, 3), None if sensor is None else round(sensor, 3))

    def tare(self, port: str, surface_mbar: float) -> None:
        """Reckon the depths of a feed from this pressure from now on."""
        decoder = self._decoders.get(port)
        if isinstance(decoder, FeedDecoder):
            decoder.tare(surface_mbar)

    def health(self, port: str, t_ns: int) -> dict[str, Json]:
        """Return what health tells of a feed's readings; nothing for the sonar.  Rates are since the call before."""
        decoder = self._decoders[port]
        if not isinstance(decoder, FeedDecoder):
            return {}
        tally, feed = self._tallies[port], self._feeds[port]
        before_ns, before = self._told.get(port, (t_ns, tally.total))
        self._told[port] = t_ns, tally.total
        ages_s = {what: round((t_ns - at_ns) / 1e9, 2) for what, at_ns in tally.newest_ns.items()}
        surface = decoder.surface
        return {
            "readings_s": round((tally.total - before) / max((t_ns - before_ns) / 1e9, 1e-3), 2),
            "age_s": {**ages_s},
            "stale": [what for what in feed.provides if ages_s.get(what, feed.stale_after_s) >= feed.stale_after_s],
            "quality": {str(name): count for name, count in tally.counts.items()},
            "now": {what: {"quality": told.quality, "reason": told.reason} for what, told in tally.now.items()},
            "last_reason": tally.last_reason,
            "field": None if decoder.field_strength is None else round(decoder.field_strength, 4),
            "undisturbed_field": feed.field_strength,
            "surface": None if surface is None else {"mbar": round(surface.mbar, 2), "origin": surface.origin},
        }

    def _surface_now(self, port: str, t_ns: int) -> float | None:
        decoder = self._decoders[port]
        return decoder.surface_now(t_ns) if isinstance(decoder, FeedDecoder) else None

    def _shown(self, t_ns: int) -> tuple[float | None, float | None]:
        heading, depth = self._heading, self._depth
        fresh_heading = heading is not None and t_ns - heading[0].t_ns <= heading[1].stale_after_s * 1e9
        fresh_depth = depth is not None and t_ns - depth[0].t_ns <= depth[1].stale_after_s * 1e9
        return (
            heading[0].heading_rad if heading is not None and fresh_heading else None,
            depth[0].depth_m if depth is not None and fresh_depth else None,
        )
