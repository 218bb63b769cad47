"""What every decoder offers, and which decoders a configuration asks for."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final, Protocol

from config.schema import Config, Feed, Sonar
from drivers.counters import Counters
from drivers.nmea import NmeaDecoder
from drivers.readings import Reading
from drivers.tritech.decoder import TritechDecoder

SONAR_PORT: Final = "sonar"
"""Name of the sonar's port; a feed's port has the feed's name."""


class Decoder(Protocol):
    """Turns the bytes of one line into readings: pure, and the same for any cutting of the stream."""

    @property
    def counters(self) -> Counters:
        """What was seen so far."""

    def push(self, t_ns: int, data: bytes) -> list[Reading]:
        """Take bytes that arrived at ``t_ns`` and return the readings that they complete."""

    def finish(self) -> list[Reading]:
        """End the stream; what is left of it is counted as skipped."""


SONARS: Final[dict[str, Callable[[Sonar], Decoder]]] = {"tritech": TritechDecoder}
FEEDS: Final[dict[str, Callable[[Feed, float], Decoder]]] = {"nmea": NmeaDecoder}
"""By the ``driver`` of the configuration; a feed's decoder also takes the declination in degrees."""


def decoders_for(config: Config) -> dict[str, Decoder]:
    """Make one decoder for each port of the configuration, by the port's name."""
    decoders: dict[str, Decoder] = {SONAR_PORT: SONARS[config.sonar.driver](config.sonar)}
    for feed in config.feed:
        decoders[feed.name] = FEEDS[feed.driver](feed, config.site.declination_deg)
    return decoders
