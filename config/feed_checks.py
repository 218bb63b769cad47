"""Checks of [[feed]] sections: keys and values that go together, or not, with the driver and the port."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final
from urllib.parse import urlsplit

from config.conflict import Conflict
from config.schema import Feed

_HEEDED: Final[dict[str, tuple[str, ...]]] = {
    "checksum": ("nmea",),
    "dpt": ("nmea",),
    "talker": ("nmea",),
    "variation": ("nmea",),
    "angle_unit": ("nmea", "videoray_pro4"),
    "xdr_depth_names": ("nmea",),
    "xdr_pressure_names": ("nmea",),
    "system": ("mavlink",),
    "heading_from": ("mavlink",),
    "pressure_message": ("mavlink",),
    "depth_points": ("videoray_pro3",),
    "poll": ("videoray_pro4", "pressure"),
    "poll_hz": ("videoray_pro4", "pressure"),
    "crc32": ("videoray_pro4",),
    "format": ("pressure",),
    "column": ("pressure",),
    "unit": ("pressure",),
    "pressure": ("nmea", "pressure"),
    "address": ("pressure",),
    "channel": ("pressure",),
    "whole_pascals": ("pressure",),
}
"""Keys that only some drivers heed."""

_TELLS: Final[dict[str, tuple[str, ...]]] = {
    "nmea": ("heading", "depth", "altitude", "odometry"),
    "mavlink": ("heading", "depth", "odometry"),
    "videoray_pro3": ("heading", "depth"),
    "videoray_pro4": ("heading", "depth"),
    "pressure": ("depth",),
}
_ANGLES: Final[dict[str, tuple[str, ...]]] = {
    "nmea": ("auto", "deg", "bam16", "mil"),
    "videoray_pro4": ("auto", "deg", "tenth_deg"),
}


def check_feed(key: str, feed: Feed) -> list[Conflict]:
    """Return the conflicts of one feed; ``key`` is where it stands: ``feed[0]``."""
    return [*_heeded(key, feed), *_tells(key, feed), *_compass(key, feed), *_points(key, feed), *_line(key, feed)]


def is_udp(port: str) -> bool:
    """Tell whether a port is an address to listen at, which cannot be written to."""
    return port.startswith("udp:")


def _heeded(key: str, feed: Feed) -> Iterator[Conflict]:
    for name in sorted(feed.model_fields_set & set(_HEEDED)):
        if feed.driver not in _HEEDED[name] and getattr(feed, name) != Feed.model_fields[name].default:
            value, drivers = getattr(feed, name), " and ".join(_HEEDED[name])
            got = "true" if value is True else repr(value)
            yield Conflict(f"{key}.{name}", got, f"no such key with {feed.driver}", f"it is for {drivers}")
    allowed = _ANGLES.get(feed.driver)
    if allowed is not None and feed.angle_unit not in allowed:
        yield Conflict(f"{key}.angle_unit", repr(feed.angle_unit), f"{', '.join(allowed)} with {feed.driver}")


def _tells(key: str, feed: Feed) -> Iterator[Conflict]:
    told = _TELLS[feed.driver]
    if not feed.provides:
        yield Conflict(f"{key}.provides", "[]", f"at least one of {', '.join(told)}", "or leave the feed out")
    for each in feed.provides:
        if each not in told:
            yield Conflict(f"{key}.provides", repr(each), f"of {', '.join(told)}, which {feed.driver} tells")


def _compass(key: str, feed: Feed) -> Iterator[Conflict]:
    headings = [heading for heading, _ in feed.deviation_deg]
    if any(not 0 <= heading < 360 for heading in headings) or len(set(headings)) < len(headings):
        yield Conflict(f"{key}.deviation_deg", str(headings), "headings from 0 to below 360, each once")
    if any(abs(added) > 180 for _, added in feed.deviation_deg):
        yield Conflict(f"{key}.deviation_deg", "a deviation beyond 180", "deviations from -180 to 180")


def _points(key: str, feed: Feed) -> Iterator[Conflict]:
    if feed.driver != "videoray_pro3":
        return
    points = feed.depth_points
    if points is None and "depth" in feed.provides:
        yield Conflict(
            f"{key}.depth_points", "nothing", "two pairs [raw count, depth in m], for each vehicle differs",
            "measure them ('lacuna probe' shows the count), or set provides = [\"heading\"]",
        )  # fmt: skip
    elif points is not None and (points[0][0] == points[1][0] or not all(0 <= raw <= 1023 for raw, _ in points)):
        yield Conflict(f"{key}.depth_points", str(points), "two different counts from 0 to 1023")


def _line(key: str, feed: Feed) -> Iterator[Conflict]:
    if feed.poll and feed.driver == "pressure" and feed.format != "keller":
        yield Conflict(f"{key}.poll", "true", 'false with format = "text"', "such sensors speak by themselves")
    if not is_udp(feed.port):
        return
    if feed.poll:
        yield Conflict(f"{key}.poll", "true", f"false, for {feed.port} only listens")
    if not _is_address(feed.port):
        yield Conflict(f"{key}.port", repr(feed.port), "udp://:PORT (this machine) or udp://ADDRESS:PORT")


def _is_address(port: str) -> bool:
    try:
        return urlsplit(port).scheme == "udp" and urlsplit(port).port is not None and port.startswith("udp://")
    except ValueError:
        return False
