"""From the lines of an NMEA 0183 instrument to what they say about heading, depth and altitude."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

from config.errors import FrameError
from config.schema import Feed
from drivers.counters import Counters
from drivers.nmea_fields import Dialect
from drivers.nmea_lines import Sentence, SentenceReader
from drivers.nmea_proprietary import WITHOUT_CHECKSUM
from drivers.nmea_sentences import read
from drivers.statements import Message
from drivers.wire import byte_ns


class NmeaReader:
    """Messages of one line; sentences that say nothing about heading or depth are counted as ``other``.

    ``checksum``: ``require`` refuses a sentence without a right one, ``warn`` counts and takes it as suspect,
    ``ignore`` does not look.  An empty checksum (``*`` and the end of the line) counts as none.
    """

    def __init__(self, feed: Feed) -> None:
        self._checksum = feed.checksum
        self._dialect = Dialect(
            angle_unit=feed.angle_unit,
            depth_names=frozenset(name.upper() for name in feed.xdr_depth_names),
            pressure_names=frozenset(name.upper() for name in feed.xdr_pressure_names),
            talker=feed.talker or "",
        )
        self._lines = SentenceReader(byte_ns(feed))
        self._frames: Counter[str] = Counter()
        self._bad: Counter[str] = Counter()

    @property
    def counters(self) -> Counters:
        """What was seen so far; sentences that begin with ``!`` (AIS) are ``encapsulated``."""
        return Counters(dict(self._frames), self._lines.skipped, dict(self._lines.bad + self._bad))

    def push(self, t_ns: int, data: bytes) -> list[Message]:
        """Take bytes that arrived at ``t_ns`` and return the messages that they complete."""
        return [message for each in self._lines.push(t_ns, data) for message in self._read(each)]

    def finish(self) -> list[Message]:
        """End the stream: a last sentence without end of line counts if its checksum is right."""
        return [message for each in self._lines.finish() for message in self._read(each)]

    def _read(self, sentence: Sentence) -> list[Message]:
        address, *fields = sentence.body.decode("ascii").split(",")
        reason = self._objection(sentence, address)
        if reason and self._checksum == "require":
            return []
        if sentence.encapsulated:
            self._frames["encapsulated"] += 1
            return []
        try:
            said = read(address, fields, self._dialect)
        except FrameError:
            self._bad["field"] += 1
            return []
        name, statements = said or ("other", [])
        self._frames[name] += 1
        if reason:
            statements = [
                each if each.reason else replace(each, quality="suspect", reason=reason) for each in statements
            ]
        return [Message(sentence.t_ns, name, tuple(statements))] if statements else []

    def _objection(self, sentence: Sentence, address: str) -> str:
        """Count and return what is wrong with the checksum, if that matters."""
        verdict = sentence.checksum
        if verdict == "right" or self._checksum == "ignore" or (verdict == "absent" and address in WITHOUT_CHECKSUM):
            return ""
        self._bad["checksum" if verdict == "wrong" else "no_checksum"] += 1
        return "wrong checksum" if verdict == "wrong" else "no checksum"
