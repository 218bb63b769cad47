"""The socket that snapshots leave by: XPUB with the last value of each topic, never slowed by a slow reader."""

from __future__ import annotations

import time
from typing import Final

import zmq

from daemon.cache import STATE_TOPICS, LastValues

_QUEUE: Final = 64
"""Messages that wait for one reader; what comes then is left out for it, and made good when it has read on."""
_FIRST_S, _LONGEST_S = 0.25, 8.0
_WATCH_S: Final = 60.0
_SUBSCRIBE: Final = 1


class Outlet:
    """Publishes numbered messages on ``socket`` (an XPUB, bound by the caller, who also closes it).

    A full queue keeps its oldest messages, so a reader that stood still would end on a stale map.  ZeroMQ tells that a
    reader has become slow, but not when it reads on: until then it is passed over without a word.  So after somebody
    was slow, what was published since is sent again from the cache, ever less often, for a minute; a reader that
    stands still for longer loses its connection, and is given everything when it comes back.
    """

    def __init__(self, socket: zmq.Socket[bytes], values: LastValues) -> None:
        socket.setsockopt(zmq.XPUB_VERBOSE, 1)
        socket.setsockopt(zmq.SNDHWM, _QUEUE)
        self._socket = socket
        self._values = values
        self._owed: set[bytes] = set()
        self._watch_until_s = 0.0
        self._retry_s = 0.0
        self._step_s = _FIRST_S

    def publish(self, frames: list[bytes]) -> None:
        """Send one message, numbered, and keep it where it is state."""
        message = self._values.take(frames)
        if message is None:
            return
        self._offer(message)
        if self._is_watching() and message[0].decode() in STATE_TOPICS:
            self._owed.add(message[0])

    def answer_subscriptions(self) -> None:
        """Send the kept state that matches the subscriptions which came since; one round answers all of them."""
        prefixes: set[bytes] = set()
        while self._socket.poll(0):
            parts = self._socket.recv_multipart()
            if parts and parts[0][:1] == bytes([_SUBSCRIBE]):
                prefixes.add(parts[0][1:])
        for message in self._values.newest(prefixes):
            self._offer(message)

    def settle(self) -> None:
        """Send again what a slow reader may have missed; called often, acts seldom."""
        now_s = time.monotonic()
        if not self._owed or now_s < self._retry_s:
            return
        for message in self._values.newest(self._owed):
            if not self._send_to_all(message):
                self._note_slow(now_s)
                break
        self._step_s = min(2 * self._step_s, _LONGEST_S)
        self._retry_s = now_s + self._step_s
        if not self._is_watching():
            self._owed.clear()

    def _offer(self, message: list[bytes]) -> None:
        """Send to all readers, or where one has no room to the others."""
        if not self._send_to_all(message):
            self._note_slow(time.monotonic())
            self._socket.setsockopt(zmq.XPUB_NODROP, 0)
            self._socket.send_multipart(message)
            if message[0].decode() in STATE_TOPICS:
                self._owed.add(message[0])

    def _send_to_all(self, message: list[bytes]) -> bool:
        """Send to all readers or, where one that was quick so far has no room, to none; say which."""
        self._socket.setsockopt(zmq.XPUB_NODROP, 1)
        try:
            self._socket.send_multipart(message, zmq.NOBLOCK, copy=len(message[-1]) < 1 << 16)
        except zmq.Again:
            return False
        return True

    def _note_slow(self, now_s: float) -> None:
        if not self._is_watching():
            self._step_s, self._retry_s = _FIRST_S, now_s + _FIRST_S
        self._watch_until_s = now_s + _WATCH_S

    def _is_watching(self) -> bool:
        return time.monotonic() < self._watch_until_s
