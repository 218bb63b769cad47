"""VideoRay Pro 3 and its kin, listened to while its own console drives it: replies of 7 bytes, without a checksum.

The vehicle answers only to packets that set its thrusters, so nothing is ever sent.  A tap on the wire from the
vehicle sees replies alone; where both wires are joined, requests of 8 bytes stand between them and are skipped whole.

A reply is ``28 31``, a type, orientation (0 to 359) and depth sensor's count (0 to 1023), both little-endian.  What
limits these have is all that tells a reply from chance: away from frames, one is believed only when the next frame
begins where it ends.  A byte lost on the way moves a header into the count, which then is too large.
"""

from __future__ import annotations

import re
from typing import Final

from config.schema import Feed
from drivers.framed import FrameReader, Said
from drivers.statements import Meaning, Statement
from drivers.wire import MORE, byte_ns

_REPLY: Final = b"\x28\x31"
_REQUEST: Final = b"\x23\x31"
_START: Final = re.compile(rb"[\x23\x28]")
_REPLY_SIZE: Final = 7
_REQUEST_SIZE: Final = 8
_FULL_THRUST: Final = 220
_FULL_LIGHT: Final = 200


def judge(buffer: bytearray, at: int, is_synced: bool) -> int | str:
    """Judge the bytes at ``at`` as a reply or a request (`drivers.wire.Judge`)."""
    head = bytes(buffer[at : at + 2])
    if len(head) < 2:
        return MORE
    if head not in (_REPLY, _REQUEST):
        return ""
    size = _REPLY_SIZE if head == _REPLY else _REQUEST_SIZE
    if len(buffer) < at + size + (0 if is_synced else 2):
        return MORE
    frame = buffer[at : at + size]
    is_plausible = _is_reply(frame) if head == _REPLY else _is_request(frame)
    is_followed = is_synced or bytes(buffer[at + size : at + size + 2]) in (_REPLY, _REQUEST)
    return size if is_plausible and is_followed else ("implausible" if is_synced else "")


def _is_reply(frame: bytearray) -> bool:
    return int.from_bytes(frame[3:5], "little") < 360 and int.from_bytes(frame[5:7], "little") < 1024


def _is_request(frame: bytearray) -> bool:
    return max(frame[2:5]) <= _FULL_THRUST and frame[5] <= _FULL_LIGHT


class Pro3:
    """Heading and depth in replies; ``depth_points`` are two counts of the vehicle's own sensor and their depths.

    Counted are ``reply`` and ``request``.
    """

    def __init__(self, feed: Feed) -> None:
        self._points = feed.depth_points
        self.count: int | None = None
        """Depth sensor's count in the newest reply, for calibration."""

    def read(self, frame: bytes) -> Said:
        """Return the name of a frame and what it says."""
        if frame[:2] == _REQUEST:
            return "request", ()
        orientation = int.from_bytes(frame[3:5], "little")
        self.count = int.from_bytes(frame[5:7], "little")
        # The sensor looks the other way round and a quarter turn off.
        heading = Statement(Meaning.MAGNETIC, float((270 - orientation) % 360))
        if self._points is None:
            return "reply", (heading,)
        (low, low_m), (high, high_m) = self._points
        depth_m = low_m + (self.count - low) * (high_m - low_m) / (high - low)
        return "reply", (heading, Statement(Meaning.DEPTH, depth_m))


def pro3_reader(feed: Feed) -> FrameReader:
    """Return the reader of a Pro 3's line."""
    return FrameReader(_START, judge, Pro3(feed), byte_ns(feed))
