"""What every decoder offers, and which decoders a configuration asks for."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Final, Protocol

from config.schema import Config, Feed, Site, Sonar
from drivers.counters import Counters
from drivers.feed import FeedDecoder
from drivers.mavlink import mavlink_reader
from drivers.nmea import NmeaReader
from drivers.pressure import pressure_reader
from drivers.readings import Reading
from drivers.records import Event
from drivers.statements import Reader
from drivers.tritech.decoder import TritechDecoder
from drivers.videoray_pro3 import pro3_reader
from drivers.videoray_pro4 import pro4_reader

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
        """End the stream, or note that it was interrupted; what is left of a message is counted as skipped."""


SONARS: Final[dict[str, Callable[[Sonar], Decoder]]] = {"tritech": TritechDecoder}
FEEDS: Final[dict[str, Callable[[Feed], Reader]]] = {
    "nmea": NmeaReader,
    "mavlink": mavlink_reader,
    "videoray_pro3": pro3_reader,
    "videoray_pro4": pro4_reader,
    "pressure": pressure_reader,
}
"""By the ``driver`` of the configuration: who reads a line's bytes."""


def feed_decoder(feed: Feed, site: Site) -> FeedDecoder:
    """Make the decoder of one feed."""
    return FeedDecoder(feed, site, FEEDS[feed.driver](feed))


def decoders_for(config: Config) -> dict[str, Decoder]:
    """Make one decoder for each port of the configuration, by the port's name."""
    decoders: dict[str, Decoder] = {SONAR_PORT: SONARS[config.sonar.driver](config.sonar)}
    return decoders | {feed.name: feed_decoder(feed, config.site) for feed in config.feed}


def heed(decoders: Mapping[str, Decoder], event: Event) -> list[Reading]:
    """Tell decoders what an event of the log means to them; return the readings that it completes.

    What comes from a port after it was lost does not go on with what came before; a ``tare`` is the pressure at the
    surface, from then on.
    """
    decoder, surface_mbar = decoders.get(str(event.fields.get("port"))), event.fields.get("surface_mbar")
    if event.kind == "port_lost" and decoder is not None:
        return decoder.finish()
    if event.kind == "tare" and isinstance(decoder, FeedDecoder) and isinstance(surface_mbar, float | int):
        decoder.tare(surface_mbar)
    return []
