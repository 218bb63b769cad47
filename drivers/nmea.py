"""From the lines of an NMEA 0183 instrument to headings, depths and altitudes.

A magnetic heading becomes one from true north with the variation that the same feed tells in HDG, or else with the
configured declination: one of the two, once.  A sentence that says its heading is true is taken at its word.
"""

from __future__ import annotations

import math
from collections import Counter

from config.errors import FrameError
from config.schema import Feed
from drivers.counters import Counters
from drivers.nmea_lines import Sentence, SentenceReader
from drivers.nmea_sentences import WITHOUT_CHECKSUM, Said, Statement, read
from drivers.readings import Altitude, Depth, Heading, Reading


class NmeaDecoder:
    """Readings of one feed, of the quantities that it provides; each is dated at the first byte of its sentence.

    ``checksum``: ``require`` refuses a sentence without a right one, ``warn`` counts and takes it, ``ignore`` does not
    look.  An empty checksum (``*`` and the end of the line) counts as none.
    """

    def __init__(self, feed: Feed, declination_deg: float) -> None:
        self._feed = feed
        self._variation_deg = declination_deg
        self._reader = SentenceReader()
        self._frames: Counter[str] = Counter()
        self._bad: Counter[str] = Counter()

    @property
    def counters(self) -> Counters:
        """What was seen so far; sentences that say nothing about heading or depth are ``other``."""
        return Counters(dict(self._frames), self._reader.skipped, dict(self._reader.bad + self._bad))

    def push(self, t_ns: int, data: bytes) -> list[Reading]:
        """Take bytes that arrived at ``t_ns`` and return the readings that they complete."""
        return [reading for sentence in self._reader.push(t_ns, data) for reading in self._read(sentence)]

    def finish(self) -> list[Reading]:
        """End the stream: a last sentence without end of line counts if its checksum is right."""
        return [reading for sentence in self._reader.finish() for reading in self._read(sentence)]

    def _read(self, sentence: Sentence) -> list[Reading]:
        address, *fields = sentence.body.decode("ascii").split(",")
        if not self._accepts(sentence, address):
            return []
        try:
            said = read(address, fields)
        except FrameError:
            self._bad["field"] += 1
            return []
        name, statements = said or ("other", [])
        self._frames[name] += 1
        readings = (self._reading(sentence.t_ns, name, each) for each in statements)
        return [reading for reading in readings if reading is not None]

    def _accepts(self, sentence: Sentence, address: str) -> bool:
        verdict, rule = sentence.checksum, self._feed.checksum
        if verdict == "right" or rule == "ignore" or (verdict == "absent" and address in WITHOUT_CHECKSUM):
            return True
        self._bad["checksum" if verdict == "wrong" else "no_checksum"] += 1
        return rule == "warn"

    def _reading(self, t_ns: int, name: str, statement: Statement) -> Reading | None:
        value, source = statement.value, f"{self._feed.name}:{name}"
        wanted = self._feed.provides
        match statement.what:
            case Said.VARIATION:
                self._variation_deg = value
            case Said.MAGNETIC if "heading" in wanted:
                return Heading(t_ns, _rad(value + self._variation_deg), source)
            case Said.TRUE if "heading" in wanted:
                return Heading(t_ns, _rad(value), source)
            case what if what in self._depths() and "depth" in wanted:
                return Depth(t_ns, value, source)
            case what if what in self._altitudes() and "altitude" in wanted:
                return Altitude(t_ns, value, source)
        return None

    def _depths(self) -> tuple[Said, ...]:
        return (Said.DEPTH, Said.BELOW_SURFACE) if self._feed.dpt == "vehicle_depth" else (Said.DEPTH,)

    def _altitudes(self) -> tuple[Said, ...]:
        return (Said.ALTITUDE, Said.ABOVE_FLOOR) if self._feed.dpt == "altitude" else (Said.ALTITUDE,)


def _rad(heading_deg: float) -> float:
    return math.radians(heading_deg % 360.0) % math.tau
