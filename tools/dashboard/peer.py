"""The daemon as the dashboard sees it: two addresses and, away from this machine, keys."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import zmq
import zmq.asyncio
import zmq.auth

from config.errors import ConfigError, UsageError
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


def curve_from(folder: Path) -> Curve:
    """Return the keys in ``folder``: ours in ``client.key_secret``, the daemon's in ``server.key``.

    Raises ConfigError where a file is missing or is no certificate.
    """
    try:
        public, secret = zmq.auth.load_certificate(folder / "client.key_secret")
        server, _ = zmq.auth.load_certificate(folder / "server.key")
    except (OSError, ValueError) as error:
        raise ConfigError(f"cannot read the keys in {folder} ({error}); make them with 'lacuna keygen'") from None
    if secret is None:
        raise ConfigError(f"{folder / 'client.key_secret'} holds no secret key; make it anew with 'lacuna keygen'")
    return Curve(public, secret, server)


@dataclass(frozen=True, slots=True)
class Peer:
    """Addresses of the daemon's snapshots (XPUB) and requests (ROUTER)."""

    snapshots: str
    requests: str
    curve: Curve | None = None

    def check(self) -> None:
        """Raise UsageError where an address is none."""
        with zmq.Context() as context, context.socket(zmq.SUB) as socket:
            socket.setsockopt(zmq.LINGER, 0)
            for address in (self.snapshots, self.requests):
                try:
                    socket.connect(address)
                except zmq.ZMQError as error:
                    raise UsageError(
                        f"'{address}' is no address ({error}); give one like tcp://127.0.0.1:5556"
                    ) from None

    def context(self) -> zmq.asyncio.Context:
        """Return a context for one event loop."""
        return zmq.asyncio.Context()

    def subscriber(self, context: zmq.asyncio.Context) -> zmq.asyncio.Socket:
        """Return a socket that hears every topic and connects again by itself."""
        socket = context.socket(zmq.SUB)
        prepare(socket, self.curve)
        socket.setsockopt(zmq.RCVHWM, _WAITING_MESSAGES)
        for topic in wire.TOPICS:
            socket.subscribe(topic)
        socket.connect(self.snapshots)
        return socket

    async def ask(self, request: bytes) -> dict[str, Any]:
        """Return the daemon's answer to a JSON ``request``, or an ``error`` in its form where none came in time."""
        with self.context() as context, context.socket(zmq.DEALER) as socket:
            prepare(socket, self.curve)
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


def prepare(socket: zmq.Socket[Any], curve: Curve | None) -> None:
    """Make ``socket`` a careful one: bounded messages, dead peers found, no waiting at the end, keys where given."""
    socket.setsockopt(zmq.LINGER, 0)
    socket.setsockopt(zmq.MAXMSGSIZE, _LARGEST_BYTES)
    socket.setsockopt(zmq.HEARTBEAT_IVL, 1000)
    socket.setsockopt(zmq.HEARTBEAT_TIMEOUT, 3000)
    socket.setsockopt(zmq.RECONNECT_IVL, 200)
    socket.setsockopt(zmq.RECONNECT_IVL_MAX, 2000)
    if curve is not None:
        socket.curve_publickey, socket.curve_secretkey = curve.public, curve.secret
        socket.curve_serverkey = curve.server


def failure(code: str, message: str, hint: str) -> dict[str, Any]:
    """Return an answer that says what failed and what to do next, in the form of the daemon's own."""
    return {"error": {"code": code, "message": message, "hint": hint}}
