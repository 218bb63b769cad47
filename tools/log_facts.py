"""What is in a session of a log: gathered in one pass, in memory that does not grow with the log."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import asdict, dataclass, field
from typing import Any, Final

from config.schema import Config
from drivers.decoders import Decoder, decoders_for, heed
from drivers.quality import Tally
from drivers.readings import Altitude, Depth, Heading, HeadSettings, Odometry, Ping, Reading, is_usable
from drivers.records import Chunk, ClockPair, Event, Record

GAP_S: Final = 2.0
"""A silence of a port that is worth telling."""

_KEPT: Final = 50
_NS: Final = 1e9


@dataclass(slots=True)
class Direction:
    """Bytes of a port one way; ``longest_gap_s`` began ``longest_gap_at_s`` after the session's first record."""

    chunks: int = 0
    bytes: int = 0
    gaps: int = 0
    longest_gap_s: float = 0.0
    longest_gap_at_s: float = 0.0
    last_s: float = 0.0

    def take(self, at_s: float, size: int) -> None:
        """Count ``size`` bytes at ``at_s``."""
        gap_s = at_s - self.last_s if self.chunks else 0.0
        self.gaps += gap_s >= GAP_S
        if gap_s > self.longest_gap_s:
            self.longest_gap_s, self.longest_gap_at_s = gap_s, self.last_s
        self.chunks, self.bytes, self.last_s = self.chunks + 1, self.bytes + size, at_s


@dataclass(slots=True)
class Values:
    """Readings of one quantity."""

    count: int = 0
    first_s: float = 0.0
    last_s: float = 0.0
    smallest: float = math.inf
    largest: float = -math.inf

    def take(self, at_s: float, value: float) -> None:
        """Count ``value`` at ``at_s``."""
        self.first_s = self.first_s if self.count else at_s
        self.count, self.last_s = self.count + 1, at_s
        self.smallest, self.largest = min(self.smallest, value), max(self.largest, value)

    @property
    def per_s(self) -> float | None:
        """Readings a second, None for fewer than two."""
        return rate(self.count - 1, self.last_s - self.first_s)


class Turning:
    """Pings, the head's way round, and its settings; a pause of the head counts for no rate."""

    def __init__(self) -> None:
        self.pings = 0
        self.settings: list[dict[str, Any]] = []
        """Settings and the time since which they held, at most the first 50."""
        self.changes = 0
        self._last: tuple[float, float] | None = None
        self._busy_s = 0.0
        self._steps = 0
        self._turned_rad = 0.0
        self._key: tuple[Any, ...] = ()

    def take(self, at_s: float, ping: Ping) -> None:
        """Count a ping."""
        self.pings += 1
        self._compare(at_s, ping)
        if self._last is not None and 0.0 < at_s - self._last[0] < GAP_S:
            self._busy_s += at_s - self._last[0]
            self._steps += 1
            self._turned_rad += abs(math.remainder(ping.bearing_rad - self._last[1], math.tau))
        self._last = (at_s, ping.bearing_rad)

    @property
    def pings_per_s(self) -> float | None:
        """Pings a second while the head was busy."""
        return rate(self._steps, self._busy_s)

    @property
    def s_per_revolution(self) -> float | None:
        """Seconds for a whole turn at the speed of the bearings; None where the head did not turn."""
        return rate(self._busy_s, self._turned_rad / math.tau)

    def _compare(self, at_s: float, ping: Ping) -> None:
        head = ping.head
        # A sector scan turns back at its limits: the sense of rotation is no change of settings.
        key = (len(ping.echoes), ping.bin_m, *(getattr(head, name) for name in _COMPARED))
        if key == self._key:
            return
        self.changes += bool(self._key)
        self._key = key
        if len(self.settings) < _KEPT:
            # A ping is of a moment before its first bytes came, perhaps before the log.
            self.settings.append({"since_s": round(max(0.0, at_s), 3)} | _shown(ping, head))


_COMPARED: Final = [name for name in HeadSettings.__dataclass_fields__ if name != "clockwise"]


def _shown(ping: Ping, head: HeadSettings) -> dict[str, Any]:
    limits = [round(math.degrees(math.remainder(each, math.tau)), 2) for each in (head.left_rad, head.right_rad)]
    return {
        "range_m": head.range_m,
        "bins": len(ping.echoes),
        "bin_m": round(ping.bin_m, 5),
        "step_deg": round(math.degrees(head.step_rad), 4),
        "gain_pct": round(head.gain_pct, 1),
        "sector_deg": None if head.continuous else limits,
    }


class Compass:
    """Smallest arc of the circle that holds all headings, to a degree."""

    def __init__(self) -> None:
        self.values = Values()
        self._seen = [False] * 360

    def take(self, at_s: float, heading_rad: float) -> None:
        """Count a heading."""
        degrees = math.degrees(heading_rad)
        self.values.take(at_s, degrees)
        self._seen[int(degrees) % 360] = True

    @property
    def arc_deg(self) -> tuple[int, int] | None:
        """Left and right end of the arc in whole degrees, None without headings."""
        seen = [degree for degree, is_seen in enumerate(self._seen) if is_seen]
        if not seen:
            return None
        gaps = [(after - before - 1) % 360 for before, after in zip(seen, seen[1:] + seen[:1], strict=True)]
        widest = max(range(len(gaps)), key=gaps.__getitem__)
        return (seen[(widest + 1) % len(seen)], seen[widest]) if gaps[widest] else (0, 359)


@dataclass(slots=True)
class PortFacts:
    """Both directions of a port, and what its decoder made of the bytes that came."""

    rx: Direction = field(default_factory=Direction)
    tx: Direction = field(default_factory=Direction)
    decoder: Decoder | None = None
    tally: Tally = field(default_factory=Tally)


class SessionFacts:
    """Takes the records of one session in their order."""

    def __init__(self, config: Config) -> None:
        self.ports: dict[str, PortFacts] = {}
        self.turning, self.compass, self.depth, self.altitude = Turning(), Compass(), Values(), Values()
        self.odometry = Values()
        self.events: Counter[str] = Counter()
        self.first_events: list[dict[str, Any]] = []
        self.clock_pairs = 0
        self.records = 0
        self.start: Record | None = None
        self.end_s = 0.0
        self._decoders = decoders_for(config)

    def take(self, record: Record) -> None:
        """Count a record."""
        self.start = self.start or record
        self.records += 1
        at_s = self._since(record.t_ns)
        self.end_s = max(self.end_s, at_s)
        if isinstance(record, Chunk):
            self._chunk(at_s, record)
        elif isinstance(record, ClockPair):
            self.clock_pairs += 1
        else:
            self._event(at_s, record)

    def finish(self) -> None:
        """End the session: decoders give what they held back."""
        for decoder in self._decoders.values():
            for reading in decoder.finish():
                self._reading(reading)

    def _since(self, t_ns: int) -> float:
        return (t_ns - (self.start.t_ns if self.start else 0)) / _NS

    def _chunk(self, at_s: float, chunk: Chunk) -> None:
        facts = self.ports.setdefault(chunk.port, PortFacts(decoder=self._decoders.get(chunk.port)))
        (facts.rx if chunk.direction == "rx" else facts.tx).take(at_s, len(chunk.data))
        if facts.decoder is not None and chunk.direction == "rx":
            for reading in facts.decoder.push(chunk.t_ns, chunk.data):
                facts.tally.take(reading)
                self._reading(reading)

    def _event(self, at_s: float, event: Event) -> None:
        self.events[event.kind] += 1
        if len(self.first_events) < _KEPT:
            self.first_events.append({"at_s": round(at_s, 3), "kind": event.kind, "fields": event.fields})
        for reading in heed(self._decoders, event):
            self._reading(reading)

    def _reading(self, reading: Reading) -> None:
        at_s = self._since(reading.t_ns)
        if not is_usable(reading):
            return
        match reading:
            case Ping():
                self.turning.take(at_s, reading)
            case Heading():
                self.compass.take(at_s, reading.heading_rad)
            case Depth():
                self.depth.take(at_s, reading.depth_m)
            case Altitude():
                self.altitude.take(at_s, reading.altitude_m)
            case Odometry():
                self.odometry.take(at_s, math.hypot(reading.dx_m, reading.dy_m))


def rate(count: float, seconds: float) -> float | None:
    """Return ``count`` a second, None where no time has passed."""
    return round(count / seconds, 4) if seconds > 0 else None


def port_body(facts: PortFacts, duration_s: float) -> dict[str, Any]:
    """Return a port's facts for JSON."""
    body: dict[str, Any] = {}
    for name, way in (("rx", facts.rx), ("tx", facts.tx)):
        numbers = {key: round(value, 3) for key, value in asdict(way).items() if key != "last_s"}
        body[name] = numbers | {"bytes_per_s": rate(way.bytes, duration_s)}
    if facts.decoder is not None:
        counters = facts.decoder.counters
        body |= {"messages": dict(counters.frames), "bad": dict(counters.bad), "skipped_bytes": counters.skipped_bytes}
        body |= {"quality": dict(facts.tally.counts), "last_reason": facts.tally.last_reason}
    return body
