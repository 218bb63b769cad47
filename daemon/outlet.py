"""The socket that snapshots leave by: XPUB with the last value of each topic, never slowed by a slow reader."""

from __future__ import annotations

import time
from typing import Final

import zmq

from daemon.cache import STATE_TOPICS, LastValues

_QUEUE: Final = 64
"""Messages that wait for one reader; what comes then is left out for it, and made good when it has read on."""
_RETRY_S: Final = 0.2
_SUBSCRIBE: Final = 1


class Outlet:
    """Publishes numbered messages on ``socket`` (an XPUB, bound by the caller, who also closes it).

    A full queue keeps its oldest messages, so a reader that stood still would end on a stale map.  What could not be
    delivered to everyone is therefore sent again, from the cache, as soon as every reader has room for it.
    """

    def __init__(self, socket: zmq.Socket[bytes], values: LastValues) -> None:
        socket.setsockopt(zmq.XPUB_VERBOSE, 1)
        socket.setsockopt(zmq.SNDHWM, _QUEUE)
        self._socket = socket
        self._values = values
        self._owed: set[bytes] = set()
        self._retry_s = 0.0

    def publish(self, frames: list[bytes]) -> None:
        """Send one message, numbered, and keep it where it is state."""
        message = self._values.take(frames)
        if message is not None and not self._send(message):
            self._owe(message[0])
            self._send_to_those_with_room(message)

    def answer_subscriptions(self) -> None:
        """Send the kept state that matches the subscriptions which came since; one round answers all of them."""
        prefixes: set[bytes] = set()
        while self._socket.poll(0):
            parts = self._socket.recv_multipart()
            if parts and parts[0][:1] == bytes([_SUBSCRIBE]):
                prefixes.add(parts[0][1:])
        if prefixes:
            self._resend(prefixes)

    def settle(self) -> None:
        """Send again what some reader had no room for; called often, acts seldom."""
        now_s = time.monotonic()
        if self._owed and now_s >= self._retry_s:
            self._retry_s = now_s + _RETRY_S
            self._resend(set(self._owed))

    def _resend(self, prefixes: set[bytes]) -> None:
        owed: set[bytes] = set()
        for message in self._values.newest(prefixes):
            if not self._send(message):
                owed.add(message[0])
        self._owed = (self._owed - prefixes) | owed

    def _owe(self, topic: bytes) -> None:
        if topic.decode() in STATE_TOPICS:
            self._owed.add(topic)

    def _send(self, message: list[bytes]) -> bool:
        """Send to all readers or to none; say whether it went."""
        self._socket.setsockopt(zmq.XPUB_NODROP, 1)
        try:
            self._socket.send_multipart(message, zmq.NOBLOCK, copy=len(message[-1]) < 1 << 16)
        except zmq.Again:
            return False
        return True

    def _send_to_those_with_room(self, message: list[bytes]) -> None:
        self._socket.setsockopt(zmq.XPUB_NODROP, 0)
        self._socket.send_multipart(message)
