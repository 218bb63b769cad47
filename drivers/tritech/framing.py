"""Frames of the Tritech Seanet serial protocol: cut out of a stream of bytes, and put together.

A frame is ``@``, its length as four hex digits and again as a little-endian word, source node, destination node, a
byte count, message id, sequence, node, payload, LF.  There is no checksum, and echoes may hold both ``@`` and LF, so
a frame is believed only if everything that is said twice agrees: both lengths, the node and its copy, the size that
its message must have, the LF where it must be.

Recovery drops one byte and looks for the next ``@`` *inside* the bytes already held, so a frame that follows or
hides in a damaged one is not lost.  A candidate is refused as soon as its first bytes contradict each other, and as
``late`` when its last byte comes too long after its first one.  Lateness compares the times of two bytes, which no
cutting of the stream changes: frames and counts are the same for any pieces.  `Deframer.expire` only refuses earlier
what the next byte would refuse anyway.
"""

from __future__ import annotations

import re
from bisect import bisect_right
from collections import Counter
from dataclasses import dataclass
from typing import Final

from config.errors import FrameError
from drivers.tritech.ids import HOST, REWRITING, MessageId
from drivers.tritech.sizes import LARGEST, STAGES, flaw

GRACE_NS: Final = 1_000_000_000
"""Pause within a frame that a slow link may make (a serial server over a radio, a busy computer)."""

_STALE: Final = 512
"""Times of dropped bytes that are kept at most."""

# An '@' with four hex digits, or the beginning of one at the end of the bytes held.
_START: Final = re.compile(rb"@(?:[0-9A-Fa-f]{4}|[0-9A-Fa-f]{0,3}\Z)")


@dataclass(frozen=True, slots=True)
class Frame:
    """One whole frame, from ``@`` to LF; ``t_ns`` is when its ``@`` came over the line."""

    t_ns: int
    data: bytes

    @property
    def source(self) -> int:
        """Node that sent the frame."""
        return self.data[7]

    @property
    def destination(self) -> int:
        """Node that the frame is for."""
        return self.data[8]

    @property
    def message_id(self) -> int:
        """Id of the message; see `drivers.tritech.ids.MessageId`."""
        return self.data[10]

    @property
    def payload(self) -> bytes:
        """What follows the 13 bytes of header, without the LF."""
        return self.data[13:-1]


class Deframer:
    """Cuts frames out of a stream of bytes, in linear time and bounded memory (one frame and the chunk pushed)."""

    def __init__(self, baud: int = 115200, *, is_wire: bool = False) -> None:
        """Expect frames at ``baud`` bits per second (ten to the byte): it widens the time a frame may take.

        With ``is_wire`` it dates them too (see `drivers.wire`): what a read gives together came one after the other.
        """
        self.skipped = 0
        self.bad: Counter[str] = Counter()
        self._byte_ns = 10_000_000_000 // baud
        self._wire_ns = self._byte_ns if is_wire else 0
        self._buffer = bytearray()
        self._base = 0
        self._offsets: list[int] = []
        self._times: list[int] = []
        self._before: list[int] = []
        self._newest_ns: int | None = None
        self._need = 0
        self._sound_at = -1
        self._deadline_ns: int | None = None

    @property
    def pending(self) -> int:
        """Bytes held that may become a frame."""
        return len(self._buffer)

    def push(self, t_ns: int, data: bytes) -> list[Frame]:
        """Take bytes that arrived at ``t_ns`` and return the frames that they complete."""
        if not data:
            return []
        if not self._buffer and b"@" not in data:
            # Noise on an idle line, the most frequent garbage: nothing of it needs to be held or dated.
            self.skipped += len(data)
            self._base += len(data)
            self._newest_ns = t_ns
            return []
        if not self._times or self._times[-1] != t_ns:
            self._offsets.append(self._base + len(self._buffer))
            self._times.append(t_ns)
            # Nothing in this chunk came before the chunk that was read before: it was not in that one.
            began_ns = t_ns - len(data) * self._wire_ns
            self._before.append(began_ns if self._newest_ns is None else min(self._newest_ns, t_ns))
            self._newest_ns = t_ns
        self._buffer += data
        if len(self._buffer) < self._need and not self._is_late(t_ns):
            return []
        return self._scan()

    def expire(self, t_ns: int) -> list[Frame]:
        """Give up a frame that can no longer end in time, and return frames found inside it."""
        return self._give_up() if self._is_late(t_ns) else []

    def finish(self) -> list[Frame]:
        """End the stream: return frames inside the unfinished one, and count the bytes that are left as skipped."""
        frames: list[Frame] = []
        while self._buffer:
            self.skipped += 1
            self._drop(1)
            frames += self._scan()
        return frames

    def _is_late(self, t_ns: int) -> bool:
        return self._deadline_ns is not None and t_ns > self._deadline_ns

    def _give_up(self) -> list[Frame]:
        self.bad["late"] += 1
        self.skipped += 1
        self._drop(1)
        return self._scan()

    def _scan(self) -> list[Frame]:
        frames: list[Frame] = []
        # Fewer bytes than tell both lengths are left alone; they have no deadline either.
        self._need, self._deadline_ns = STAGES[0], None
        at = self._seek(0, 0)
        while (held := len(self._buffer) - at) >= STAGES[0]:
            size = int(self._buffer[at + 1 : at + 5], 16) + 6
            chunk = bisect_right(self._offsets, self._base + at) - 1
            deadline_ns = self._times[chunk] + self._limit_ns(size)
            reason = self._flaw(at, size, held, is_quick=self._times[-1] <= deadline_ns)
            if reason is not None:
                self.bad[reason] += 1
                at = self._seek(at, at + 1)
            elif held >= size:
                frames.append(Frame(self._came(at, chunk), bytes(self._buffer[at : at + size])))
                at = self._seek(at + size, at + size)
            else:
                self._need = min(STAGES[1] if held < STAGES[1] else STAGES[2] if held < STAGES[2] else size, size)
                self._deadline_ns = deadline_ns
                break
        self._drop(at)
        return frames

    def _seek(self, start: int, look_from: int) -> int:
        """Find the next possible beginning of a frame; count the bytes from ``start`` to there as skipped."""
        found = _START.search(self._buffer, look_from)
        at = found.start() if found else len(self._buffer)
        self.skipped += at - start
        return at

    def _flaw(self, at: int, size: int, held: int, *, is_quick: bool) -> str | None:
        if is_quick:
            reason = self._quick_flaw(at, size, held)
        else:
            reason = self._slow_flaw(at, bytes(self._buffer[at : at + min(held, size, STAGES[-1])]), size, held)
        if reason is not None:
            return reason
        return "end" if held >= size and self._buffer[at + size - 1] != 0x0A else None

    def _quick_flaw(self, at: int, size: int, held: int) -> str | None:
        """Judge all bytes at once, and those of a frame that grows only until nothing more can speak against it."""
        if self._sound_at == self._base + at:
            return None
        reason = flaw(self._buffer[at : at + min(held, size, STAGES[-1])], size)
        if reason is None and held >= min(size, STAGES[-1]):
            self._sound_at = self._base + at
        return reason

    def _slow_flaw(self, at: int, start: bytes, size: int, held: int) -> str | None:
        """Judge stage by stage, as if the bytes came one by one, so that the reason is the same however they came."""
        for stage in (*STAGES, size):
            have = min(stage, size, held)
            if have > STAGES[0] and self._time(at + have - 1) - self._time(at) > self._limit_ns(size):
                return "late"
            reason = flaw(start[:have], size)
            if reason is not None:
                return reason
            if have < stage:
                break
        return None

    def _limit_ns(self, size: int) -> int:
        return GRACE_NS + 2 * size * self._byte_ns

    def _time(self, at: int) -> int:
        return self._times[bisect_right(self._offsets, self._base + at) - 1]

    def _came(self, at: int, chunk: int) -> int:
        """Return when the first bit of a byte came: so long before the end of its chunk as the bytes behind it took."""
        t_ns = self._times[chunk]
        if not self._wire_ns:
            return t_ns
        is_newest = chunk + 1 == len(self._offsets)
        end = self._base + len(self._buffer) if is_newest else self._offsets[chunk + 1]
        return max(self._before[chunk], t_ns - (end - self._base - at) * self._wire_ns)

    def _drop(self, count: int) -> None:
        del self._buffer[:count]
        self._base += count
        gone = bisect_right(self._offsets, self._base) - 1 if self._buffer else len(self._offsets)
        # Seldom, because the rest of a list moves with each removal at its front.
        if gone >= _STALE or not self._buffer:
            del self._offsets[:gone], self._times[:gone], self._before[:gone]


def wrap(message_id: int, payload: bytes, source: int, destination: int, head: int) -> bytes:
    """Put a message into a frame; ``head`` is the node of the head, whichever way the frame goes.

    Raises FrameError for a message that would rewrite a head or is too long for a frame.
    """
    if message_id in REWRITING:
        raise FrameError(f"message {message_id} rewrites the head; lacuna never sends it")
    length = len(payload) + 8
    if length + 6 > LARGEST:
        raise FrameError(f"a message of {len(payload)} bytes does not fit a frame; send at most {LARGEST - 14}")
    # In HeadData a zero says that the message is not split over several packets.
    count = 0 if message_id == MessageId.HEAD_DATA else (length - 5) & 0xFF
    lengths = b"@%04X" % length + length.to_bytes(2, "little")
    return lengths + bytes((source, destination, count, message_id, 0x80, head)) + payload + b"\n"


def wrap_reply(message_id: int, payload: bytes, head: int = 2) -> bytes:
    """Frame of a message from a head to the host."""
    return wrap(message_id, payload, head, HOST, head)


def wrap_command(message_id: MessageId, payload: bytes, head: int = 2) -> bytes:
    """Frame of a message from the host to a head."""
    return wrap(message_id, payload, HOST, head, head)
