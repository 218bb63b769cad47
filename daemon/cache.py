"""The newest state by topic, for those who join late, and the numbering of messages."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

from daemon.wire import numbered
from drivers.records import Json

STATE_TOPICS: Final = ("station", "grid/key", "grid/delta", "fill", "mesh", "guide", "health")
"""Topics of which the newest message says everything; beams and events pass and are not kept."""

_KEY: Final = b"grid/key"
_DELTA: Final = b"grid/delta"


class LastValues:
    """Numbers the messages of a session and keeps the newest of each topic.

    A grid is its last key and every delta since; a delta's ``base`` is the message of the grid that was numbered
    before it, whichever process made either.
    """

    def __init__(self, session: str) -> None:
        self.session = session
        self.numbers: dict[str, int] = {}
        """The newest ``seq`` of each topic."""
        self._newest: dict[bytes, list[bytes]] = {}
        self._deltas: list[list[bytes]] = []
        self._base: dict[str, Json] | None = None

    def take(self, frames: list[bytes]) -> list[bytes] | None:
        """Return ``frames`` numbered; None for a delta that has no key to apply to.  Raises as ``wire.head`` does."""
        topic = frames[0].decode()
        if frames[0] == _DELTA and self._base is None:
            return None
        seq = self.numbers.get(topic, -1) + 1
        message = numbered(frames, seq, self.session, self._base if frames[0] == _DELTA else None)
        self.numbers[topic] = seq
        self._keep(message, topic, seq)
        return message

    def newest(self, prefixes: Iterable[bytes]) -> list[list[bytes]]:
        """Return the kept messages of the topics that begin with any of ``prefixes``, in an order that applies.

        Who asks for a part of the grid gets all of it: a key alone would take other readers of it back in time.
        """
        wanted = {name for name in map(str.encode, STATE_TOPICS) if any(name.startswith(each) for each in prefixes)}
        wanted |= {_KEY} if _DELTA in wanted else set()
        messages = [message for name, message in self._newest.items() if name in wanted]
        return messages + (self._deltas if _KEY in wanted else [])

    def _keep(self, message: list[bytes], topic: str, seq: int) -> None:
        if topic == _DELTA.decode():
            self._deltas.append(message)
        elif topic in STATE_TOPICS:
            self._newest[message[0]] = message
        if topic == _KEY.decode():
            self._deltas.clear()
        if message[0] in (_KEY, _DELTA):
            self._base = {"topic": topic, "seq": seq}
