"""What one browser still has to get: of each kind only the newest, however slowly it reads."""

from __future__ import annotations

import json
from typing import Any, Final

import numpy as np

from daemon.wire import VERSION, Message
from tools.dashboard.memory import EVENTS_KEPT, Memory, bearing_slot

_GRID: Final = "grid"


class Outbox:
    """Messages that wait for one browser; its size is bounded by the number of kinds, beams and kept events."""

    def __init__(self, memory: Memory) -> None:
        self._memory = memory
        self._waiting: dict[str, Message | None] = {}

    def __len__(self) -> int:
        return len(self._waiting)

    def offer(self, message: Message) -> None:
        """Keep ``message``; it takes the place of an older one of its kind."""
        slot = _slot(message)
        if slot == _GRID and slot in self._waiting:
            # Two pieces of the grid cannot both be newest: the whole grid is sent in their place.
            self._waiting[slot] = None
            return
        if message.snapshot.topic == "ping":
            self._waiting.pop(slot, None)
        elif message.snapshot.topic == "event":
            self._forget_old_events()
        self._waiting[slot] = message

    def take(self) -> bytes | None:
        """Return the next websocket frame, None where nothing waits."""
        while self._waiting:
            slot = next(iter(self._waiting))
            message = self._waiting.pop(slot)
            if message is None:
                message = self._memory.grid
            if message is not None:
                return pack(message)
        return None

    def clear(self) -> None:
        """Drop everything, as at a new session."""
        self._waiting.clear()

    def _forget_old_events(self) -> None:
        events = [slot for slot in self._waiting if slot.startswith("event ")]
        for slot in events[: max(0, len(events) + 1 - EVENTS_KEPT)]:
            del self._waiting[slot]


def pack(message: Message) -> bytes:
    """Return a message as one websocket frame.

    Four bytes with the header's length (little-endian), the header as JSON in UTF-8, the arrays' little-endian bytes
    one after another as ``arrays`` in the header lists them: a browser needs no zstd.
    """
    snapshot = message.snapshot
    arrays = {name: np.ascontiguousarray(each, each.dtype.newbyteorder("<")) for name, each in snapshot.arrays.items()}
    header: dict[str, Any] = {
        **snapshot.fields,
        "v": VERSION,
        "topic": snapshot.topic,
        "seq": message.seq,
        "session": message.session,
        "t_ns": snapshot.t_ns,
        "utc_ns": snapshot.utc_ns,
        "arrays": [{"name": name, "dtype": each.dtype.name, "shape": each.shape} for name, each in arrays.items()],
    }
    text = json.dumps(header, separators=(",", ":"), allow_nan=False).encode()
    return b"".join([len(text).to_bytes(4, "little"), text, *(each.tobytes() for each in arrays.values())])


def _slot(message: Message) -> str:
    topic = message.snapshot.topic
    if topic == "ping":
        return f"ping {bearing_slot(message)}"
    if topic == "event":
        return f"event {message.seq}"
    return _GRID if topic.startswith("grid/") else topic
