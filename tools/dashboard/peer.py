"""The daemon as the dashboard sees it: two addresses and, away from this machine, keys."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Any, Final

import zmq
import zmq.asyncio

from daemon import wire

ANSWER_S: Final = 3.0
_LARGEST_BYTES: Final = 1 << 28
_WAITING_MESSAGES: Final = 300


@dataclass(frozen=True, slots=True)
class Curve:
    """CURVE keys as Z85 text: ours and the daemon's public one."""

    public: bytes
    secret: bytes
    server: bytes


@dataclass(frozen=True, slots=True)
class Peer:
    """Addresses of the daemon's snapshots (XPUB) and requests (ROUTER)."""

    snapshots: str
    requests: str
    curve: Curve | None = None

    def context(self) -> zmq.asyncio.Context:
        """Return a context for one event loop."""
        return zmq.asyncio.Context()

    def subscriber(self, context: zmq.asyncio.Context) -> zmq.asyncio.Socket:
        """Return a socket that hears every topic and connects again by itself."""
        socket = self._prepared(context.socket(zmq.SUB))
        socket.setsockopt(zmq.RCVHWM, _WAITING_MESSAGES)
        for topic in wire.TOPICS:
            socket.subscribe(topic)
        socket.connect(self.snapshots)
        return socket

    async def ask(self, request: bytes) -> dict[str, Any]:
        """Return the daemon's answer to a JSON ``request``, or an ``error`` in its form where none came in time."""
        with self.context() as context, self._prepared(context.socket(zmq.DEALER)) as socket:
            socket.connect(self.requests)
            await socket.send(request)
            if not await socket.poll(int(ANSWER_S * 1000)):
                return failure(
                    "no-answer", f"The daemon at {self.requests} does not answer.", "Is 'lacuna run' running?"
                )
            frames = await socket.recv_multipart()
        try:
            answer = json.loads(frames[-1])
        except ValueError:
            answer = None
        if not isinstance(answer, dict):
            return failure(
                "bad-answer", "The daemon's answer cannot be read.", "Are both programs of the same version?"
            )
        return answer

    def _prepared(self, socket: zmq.asyncio.Socket) -> zmq.asyncio.Socket:
        socket.setsockopt(zmq.LINGER, 0)
        socket.setsockopt(zmq.MAXMSGSIZE, _LARGEST_BYTES)
        socket.setsockopt(zmq.HEARTBEAT_IVL, 1000)
        socket.setsockopt(zmq.HEARTBEAT_TIMEOUT, 3000)
        socket.setsockopt(zmq.RECONNECT_IVL, 200)
        socket.setsockopt(zmq.RECONNECT_IVL_MAX, 2000)
        if self.curve is not None:
            socket.curve_publickey, socket.curve_secretkey = self.curve.public, self.curve.secret
            socket.curve_serverkey = self.curve.server
        return socket


def failure(code: str, message: str, hint: str) -> dict[str, Any]:
    """Return an answer that says what failed and what to do next, in the form of the daemon's own."""
    return {"error": {"code": code, "message": message, "hint": hint}}
