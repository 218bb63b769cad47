"""What the lines of a foreign recording speak: found by listening with every decoder there is."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

from config.schema import Feed, Quantity, Site
from drivers.decoders import FEEDS, Decoder, feed_decoder
from drivers.guess import guess_columns
from drivers.readings import Altitude, Depth, Heading, Odometry, Reading
from drivers.records import Json
from drivers.tritech.framing import Deframer, Frame
from drivers.tritech.headdata import HeadData, decode_head_data
from drivers.tritech.ids import MessageId
from tools.importers.capture import Captured

SONAR_DRIVER: Final = "tritech"
_SAMPLE_BYTES: Final = 16 << 10
"""So much of a line is kept to find out what its columns are."""
QUANTITIES: Final[dict[type[Reading], Quantity]] = {
    Heading: "heading",
    Depth: "depth",
    Altitude: "altitude",
    Odometry: "odometry",
}


class LineProbe:
    """Listens to what one line received."""

    def __init__(self, name: str, baud: int) -> None:
        self.name = name
        self.rx_bytes = 0
        self.pings = 0
        self.head: tuple[int, HeadData] | None = None
        """Node and first ping of a sonar's head."""
        self._frame_bytes = 0
        self._deframer = Deframer(baud)
        self._feeds = {driver: _FeedProbe(driver, {}) for driver in FEEDS}
        self._keller = _FeedProbe("pressure", {"format": "keller"})
        self._sample = bytearray()

    def push(self, t_ns: int, data: bytes) -> None:
        """Take bytes that the line received at ``t_ns``."""
        self.rx_bytes += len(data)
        for frame in self._deframer.push(t_ns, data):
            self._take(frame)
        for feed in (*self._feeds.values(), self._keller):
            feed.push(t_ns, data)
        self._sample += data[: _SAMPLE_BYTES - len(self._sample)]

    @property
    def driver(self) -> str | None:
        """The driver that understands the line, None where none does."""
        # Any text with numbers could be a pressure sensor's: only one that tells its unit is.
        guesses = [(driver, feed) for driver, feed in self._feeds.items() if driver != "pressure"]
        guesses += [("pressure", self._keller)]
        driver, feed = max(guesses, key=lambda item: item[1].score)
        if not feed.score and self._columns is not None:
            driver, feed = "pressure", self._feeds["pressure"]
        # Echoes may hold a sentence by chance and text never a frame, so frames of any weight decide.
        if self._frame_bytes * 5 >= self.rx_bytes > 0 or (self._frame_bytes and not feed.score):
            return SONAR_DRIVER
        return driver if feed.score else None

    def feed(self, name: str, driver: str, baud: int) -> Feed:
        """Return the configuration of the line as a feed: what it provides, and as strict as it allows."""
        settings: dict[str, object] = {"name": name, "driver": driver, "port": f"import:{self.name}", "baud": baud}
        probe = self._feeds[driver]
        if driver == "pressure" and self._keller.score:
            settings["format"] = "keller"
        elif driver == "pressure":
            settings |= self._columns or {}
        elif probe.quantities:
            settings |= {"provides": probe.quantities, "checksum": probe.checksum}
        return Feed.model_validate(settings)

    def quantities(self, driver: str) -> tuple[Quantity, ...]:
        """Return what the line provides when ``driver`` listens to it."""
        return self._feeds[driver].quantities

    @property
    def _columns(self) -> dict[str, Json] | None:
        return guess_columns(bytes(self._sample))

    def _take(self, frame: Frame) -> None:
        self._frame_bytes += len(frame.data)
        if frame.message_id == MessageId.HEAD_DATA and frame.data[9] == 0:
            self.pings += 1
            self.head = self.head or (frame.source, decode_head_data(frame))


class _FeedProbe:
    """One feed's driver, once asking for checksums and once not."""

    def __init__(self, driver: str, settings: dict[str, str]) -> None:
        self._strict = _listener(driver, "require", settings)
        self._lenient = _listener(driver, "ignore", settings)
        self._said: dict[Decoder, set[Quantity]] = {self._strict: set(), self._lenient: set()}
        self._readings = 0

    def push(self, t_ns: int, data: bytes) -> None:
        for decoder, said in self._said.items():
            readings = decoder.push(t_ns, data)
            said |= _quantities(readings)
            self._readings += len(readings)

    @property
    def score(self) -> int:
        """Sentences with their checksum; without any, the readings; requests alone are nobody's."""
        counts = self._strict.counters.frames
        return sum(count for name, count in counts.items() if name != "request") or self._readings

    @property
    def checksum(self) -> str:
        return "require" if self._said[self._strict] else "warn"

    @property
    def quantities(self) -> tuple[Quantity, ...]:
        said = self._said[self._strict] or self._said[self._lenient]
        return tuple(each for each in QUANTITIES.values() if each in said)


def _listener(driver: str, checksum: str, settings: dict[str, str]) -> Decoder:
    # An autopilot always reckons its way, with or without an instrument for it: the operator must say so.
    everything = [each for each in QUANTITIES.values() if each != "odometry" or driver == "nmea"]
    feed = Feed.model_validate({"driver": driver, "checksum": checksum, "provides": everything, **settings})
    return feed_decoder(feed, Site())


def _quantities(readings: Iterable[Reading]) -> set[Quantity]:
    return {QUANTITIES[type(reading)] for reading in readings if type(reading) in QUANTITIES}


class Survey:
    """First pass over a recording: its lines in the order in which they appear, and its span of time."""

    def __init__(self, captured: Iterable[Captured], baud: int) -> None:
        self.lines: dict[str, LineProbe] = {}
        self.pieces = 0
        self.first: Captured | None = None
        self.earliest_t_ns = 0
        """The smallest time, 0 where none is negative."""
        for each in captured:
            self.pieces += 1
            self.first = self.first or each
            self.earliest_t_ns = min(self.earliest_t_ns, each.t_ns)
            if each.line not in self.lines:
                self.lines[each.line] = LineProbe(each.line, baud)
            if each.direction == "rx":
                self.lines[each.line].push(each.t_ns, each.data)
