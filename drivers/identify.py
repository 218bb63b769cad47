"""What speaks on a line: every driver listens to the same bytes, and says how much of them it understands.

Only whole messages count whose checksum, or all of whose redundancy, is right.  Where several drivers find some, the
one that understands the largest share of the bytes is right, for at a wrong baud rate none understands much.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Final

from config.schema import Feed, Quantity, Site
from drivers.decoders import FEEDS
from drivers.feed import FeedDecoder
from drivers.framed import FrameReader
from drivers.guess import guess_columns
from drivers.keller import Keller
from drivers.mavlink import Mavlink
from drivers.nmea import NmeaReader
from drivers.readings import Altitude, Depth, Heading, Odometry, Reading
from drivers.records import Json
from drivers.statements import Reader
from drivers.tritech.framing import Deframer
from drivers.tritech.ids import HOST, name_of
from drivers.videoray_pro3 import Pro3
from drivers.videoray_pro4 import Pro4

Pieces = Sequence[tuple[int, bytes]]

_LEAST_SHARE: Final = 0.3
_LEAST_MESSAGES: Final = {("videoray_pro3", "text"): 3, ("pressure", "text"): 4}
"""By driver and format: what carries no checksum must be heard several times; once is enough of what does."""
_UNCHECKED: Final = {"other", "other_system", "request"}
"""Messages that are known by little, or are not the device's own."""
_LINE: Final = "socket://line:0"
_QUANTITIES: Final[dict[type[Reading], Quantity]] = {
    Heading: "heading",
    Depth: "depth",
    Altitude: "altitude",
    Odometry: "odometry",
}


@dataclass(frozen=True, slots=True)
class Heard:
    """What one driver understood: of ``share`` of the bytes (0 to 1), in ``messages`` by name.

    ``section`` and ``settings`` are the lines of the configuration that it gives; ``says`` is for people, and
    ``advice`` what they alone can know.
    """

    driver: str
    section: str
    says: str
    messages: dict[str, int]
    share: float
    settings: dict[str, Json] = field(default_factory=dict)
    advice: str = ""


def identify(pieces: Pieces) -> list[Heard]:
    """Return who understands the bytes of a line, the best first; none if they are nothing known."""
    size = sum(len(data) for _, data in pieces)
    found = [_tritech(pieces, size), *(_feed(feed, pieces, size) for feed in _listeners())]
    return sorted((each for each in found if each is not None), key=lambda each: -each.share)


def _listeners() -> list[Feed]:
    return [
        Feed(port=_LINE, provides=("heading", "depth", "altitude", "odometry")),
        Feed(driver="mavlink", port=_LINE),
        Feed(driver="videoray_pro3", port=_LINE),
        Feed(driver="videoray_pro4", port=_LINE),
        Feed(driver="pressure", format="keller", port=_LINE),
        Feed(driver="pressure", port=_LINE),
    ]


def _tritech(pieces: Pieces, size: int) -> Heard | None:
    deframer = Deframer()
    frames = [frame for t_ns, data in pieces for frame in deframer.push(t_ns, data)] + deframer.finish()
    messages = Counter(name_of(frame.message_id) for frame in frames)
    nodes = Counter(frame.source for frame in frames if frame.source != HOST)
    share = sum(len(frame.data) for frame in frames) / max(size, 1)
    if not nodes or share < _LEAST_SHARE:
        return None
    node = nodes.most_common(1)[0][0]
    settings: dict[str, Json] = {"driver": "tritech", "node": node}
    return Heard("tritech", "sonar", f"Tritech head, node {node}", dict(messages), share, settings)


def _feed(feed: Feed, pieces: Pieces, size: int) -> Heard | None:
    is_text = (feed.driver, feed.format) == ("pressure", "text")
    columns = guess_columns(b"".join(data for _, data in pieces)) if is_text else None
    feed = feed.model_copy(update=columns or {})
    reader = FEEDS[feed.driver](feed)
    decoder = FeedDecoder(feed, Site(), reader)
    readings = [reading for t_ns, data in pieces for reading in decoder.push(t_ns, data)] + decoder.finish()
    counters = reader.counters
    unchecked = () if feed.driver == "nmea" else _UNCHECKED
    right = sum(count for name, count in counters.frames.items() if name not in unchecked)
    share = (1.0 - counters.skipped_bytes / max(size, 1)) * right / max(right + sum(counters.bad.values()), 1)
    if right < _LEAST_MESSAGES.get((feed.driver, feed.format), 1) or share < _LEAST_SHARE:
        return None
    told = {_QUANTITIES[type(reading)] for reading in readings if type(reading) in _QUANTITIES}
    settings: dict[str, Json] = {"driver": feed.driver, "name": feed.driver}
    if feed.format == "keller":
        settings["format"] = "keller"
    settings |= columns or {}
    settings["provides"] = [each for each in _QUANTITIES.values() if each in told]
    says, advice = _described(reader), "" if columns else _advice(reader)
    return Heard(feed.driver, "feed", says, dict(counters.frames), share, settings, advice)


def _described(reader: Reader) -> str:
    match reader.interpreter if isinstance(reader, FrameReader) else reader:
        case NmeaReader():
            names = sorted(set(reader.counters.frames) - {"other", "encapsulated"})
            return f"NMEA 0183 ({', '.join(names) or 'nothing about heading or depth'})"
        case Mavlink(speaker=speaker):
            return f"MAVLink, {speaker or 'a vehicle'}"
        case Pro3():
            return "VideoRay Pro 3"
        case Pro4():
            return "VideoRay Pro 4"
        case Keller(serial=serial):
            return "Keller pressure sensor" + (f", serial number {serial}" if serial is not None else "")
        case _:
            return "numbers in lines of text"


def _advice(reader: Reader) -> str:
    match reader.interpreter if isinstance(reader, FrameReader) else reader:
        case NmeaReader():
            is_below = {"DPT", "DBT", "DBK"} & set(reader.counters.frames)
            return 'dpt = "altitude" if these depths are the water below the vehicle' if is_below else ""
        case Pro3(count=count):
            return f"for depths, set depth_points; the depth sensor's count is {count} now"
        case Mavlink() | Pro4() | Keller():
            return "depths need the pressure at the surface: set surface_mbar, or take a tare there"
        case _:
            return "set column and unit"
