"""What tests of feeds share: a decoder run over pieces, readings in plain words, lines cut anywhere."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from itertools import pairwise

from hypothesis import strategies as st

from config.schema import Feed, Site
from drivers.counters import Counters
from drivers.decoders import feed_decoder
from drivers.readings import Altitude, Depth, Heading, Reading
from drivers.wire import byte_ns

START_NS = 5_000_000_000
CUTS = st.lists(st.integers(0, 400), max_size=8)


def run(feed: Feed, pieces: Iterable[tuple[int, bytes]], site: Site | None = None) -> tuple[list[Reading], Counters]:
    decoder = feed_decoder(feed, site or Site())
    readings = [reading for t_ns, data in pieces for reading in decoder.push(t_ns, data)]
    return readings + decoder.finish(), decoder.counters


def plain(reading: Reading) -> tuple[str, float]:
    """Kind and value of a reading, in degrees or metres."""
    match reading:
        case Heading(heading_rad=heading_rad):
            return "heading", round(math.degrees(heading_rad), 6)
        case Depth(depth_m=depth_m):
            return "depth", round(depth_m, 6)
        case Altitude(altitude_m=altitude_m):
            return "altitude", round(altitude_m, 6)
    raise AssertionError(reading)


def opinions(readings: Sequence[Reading]) -> list[tuple[str, str]]:
    return [(each.quality, each.reason) for each in readings if isinstance(each, Heading | Depth | Altitude)]


def cut_on_wire(feed: Feed, data: bytes, edges: Iterable[int]) -> list[tuple[int, bytes]]:
    """Cut ``data`` at ``edges``; each piece is read when its last byte has come, the bytes coming without a pause."""
    places = [0, *sorted({min(edge, len(data)) for edge in edges}), len(data)]
    return [(START_NS + end * byte_ns(feed), data[begin:end]) for begin, end in pairwise(places) if end > begin]


def assert_any_cut_is_the_same(feed: Feed, data: bytes, cuts: list[int]) -> list[Reading]:
    """Readings, their dates and the counts are the same for the whole, for single bytes and for pieces."""
    network = feed.model_copy(update={"port": "socket://peer:1"})
    results: list[Callable[[Iterable[int]], tuple[list[Reading], Counters]]] = [
        lambda edges: run(feed, cut_on_wire(feed, data, edges)),
        lambda edges: run(network, cut_on_wire(network, data, edges)),
    ]
    for result in results:
        whole = result([])
        assert result(range(len(data))) == whole
        assert result(cuts) == whole
    return results[0]([])[0]
