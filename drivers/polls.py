"""Requests for devices that speak only when asked, where the operator has said that lacuna may ask.

Only requests without an effect can be built here: VideoRay's with no data, which writes nothing, and a sensor's.
"""

from __future__ import annotations

from typing import Final

from config.schema import Feed
from drivers.keller import initialise, read_channel, read_serial
from drivers.videoray_pro4 import navigation_request

_NS: Final = 1_000_000_000
_READS_PER_START: Final = 20
"""A sensor that lost its power meanwhile is made ready again after so many requests."""


class Poller:
    """Says what to send on a feed's line, and when: on a half-duplex line the answer has ended by the next request."""

    def __init__(self, feed: Feed) -> None:
        self._round = _round(feed) if feed.poll else []
        self._period_ns = round(_NS / feed.poll_hz)
        self._next = 0
        self._due_ns: int | None = None

    def tick(self, t_ns: int) -> bytes:
        """Return what to send at ``t_ns``, mostly nothing."""
        if not self._round or (self._due_ns is not None and t_ns < self._due_ns):
            return b""
        self._due_ns = t_ns + self._period_ns
        request = self._round[self._next]
        self._next = (self._next + 1) % len(self._round)
        return request


def _round(feed: Feed) -> list[bytes]:
    if feed.driver == "videoray_pro4":
        return [navigation_request(crc=feed.crc32)]
    if feed.driver == "pressure" and feed.format == "keller":
        reads = [read_channel(feed.address, feed.channel, whole=feed.whole_pascals)] * _READS_PER_START
        return [initialise(feed.address), read_serial(feed.address), *reads]
    return []
