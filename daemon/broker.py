"""The two sockets that others reach: snapshots on an XPUB, requests on a ROUTER."""

from __future__ import annotations

import contextlib
import errno
from collections.abc import Callable
from pathlib import Path
from typing import Final, Self

import zmq
import zmq.auth
from zmq.auth.thread import ThreadAuthenticator

from config.checks import is_loopback
from config.errors import ConfigError, FrameError, PortError
from config.schema import Publish
from daemon import requests
from daemon.cache import LastValues
from daemon.outlet import Outlet
from daemon.requests import Refusal, Request

_HEARTBEAT_MS: Final = 1000
_SILENT_MS: Final = 5000
_ANSWERS: Final = 1000
"""Answers that wait for one client; more are dropped."""

Route = tuple[bytes, ...]
"""Frames that lead an answer back to who asked."""

Ask = Callable[[Route, Request], None]
"""Called with each request that is right; answers now or later with ``Broker.answer``."""


class Broker:
    """Binds both sockets, or raises before anything is recorded.

    Raises PortError where an address is taken and ConfigError where it is not this machine's, or where it is not
    loopback and no keys are configured.  With keys, on any address, both sockets speak CURVE and only to the public
    keys in the folder's ``authorized``.
    """

    def __init__(self, publish: Publish, session: str, ask: Ask | None = None) -> None:
        if publish.keys is None and not is_loopback(publish.bind):
            raise ConfigError(f"{publish.bind} is not loopback: set [publish] keys to a folder made by 'lacuna keygen'")
        self.values = LastValues(session)
        self.ask = ask
        """Who deals with requests; without it they are refused."""
        self._context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
        self._door: ThreadAuthenticator | None = None
        self._others: dict[zmq.Socket[bytes], Callable[[], None]] = {}
        try:
            self._open(publish)
        except BaseException:
            self.close()
            raise

    def _open(self, publish: Publish) -> None:
        if publish.keys is not None:
            self._door = _authenticator(self._context, Path(publish.keys))
        self._snapshots = self._socket(zmq.XPUB, publish, largest=4096)
        self.outlet = Outlet(self._snapshots, self.values)
        _bind(self._snapshots, publish.bind, publish.port)
        self._requests = self._socket(zmq.ROUTER, publish, largest=4 * requests.LARGEST_BYTES)
        self._requests.setsockopt(zmq.SNDHWM, _ANSWERS)
        _bind(self._requests, publish.bind, publish.request_port)
        self._poller = zmq.Poller()
        self.listen(self._snapshots, self.outlet.answer_subscriptions)
        self.listen(self._requests, self._take_requests)

    def listen(self, socket: zmq.Socket[bytes], serve: Callable[[], None]) -> None:
        """Call ``serve`` whenever ``socket``, of any context, has something to read."""
        self._others[socket] = serve
        self._poller.register(socket, zmq.POLLIN)

    def turn(self, wait_s: float) -> None:
        """Serve what has come, waiting for it at most ``wait_s``."""
        for socket, _ in self._poller.poll(int(wait_s * 1000)):
            self._others[socket]()
        self.outlet.settle()

    def publish(self, frames: list[bytes]) -> None:
        """Send a message to the subscribers; one that cannot be read is left out."""
        with contextlib.suppress(FrameError):
            self.outlet.publish(frames)

    def answer(self, route: Route, data: bytes, more: list[bytes] | None = None) -> None:
        """Send an answer back along ``route``; a client that has gone or does not read loses it."""
        with contextlib.suppress(zmq.Again, zmq.ZMQError):
            self._requests.send_multipart([*route, data, *(more or [])], zmq.NOBLOCK)

    def close(self) -> None:
        """Close sockets and threads; what a reader has not taken yet gets a moment to leave."""
        for name in ("_snapshots", "_requests"):
            socket: zmq.Socket[bytes] | None = getattr(self, name, None)
            if socket is not None:
                socket.close(linger=200)
        if self._door is not None:
            self._door.stop()
        self._context.term()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _socket(self, kind: int, publish: Publish, largest: int) -> zmq.Socket[bytes]:
        socket = self._context.socket(kind)
        socket.setsockopt(zmq.LINGER, 0)
        socket.setsockopt(zmq.MAXMSGSIZE, largest)
        socket.setsockopt(zmq.HEARTBEAT_IVL, _HEARTBEAT_MS)
        socket.setsockopt(zmq.HEARTBEAT_TIMEOUT, _SILENT_MS)
        socket.setsockopt(zmq.TCP_KEEPALIVE, 1)
        socket.setsockopt(zmq.IPV6, int("[" in publish.bind))
        if publish.keys is not None:
            public, secret = zmq.auth.load_certificate(Path(publish.keys) / "server.key_secret")
            socket.curve_publickey, socket.curve_secretkey, socket.curve_server = public, secret, True
        return socket

    def _take_requests(self) -> None:
        while self._requests.poll(0):
            parts = self._requests.recv_multipart()
            # A REQ client puts an empty frame before its words, a DEALER none: the answer goes back the same way.
            split = 2 if len(parts) > 2 and parts[1] == b"" else 1
            route, words = tuple(parts[:split]), parts[split:]
            said = requests.parse(b"".join(words))
            if isinstance(said, Request) and self.ask is None:
                said = Refusal(said.id, "unavailable", "nobody deals with requests yet", "ask again")
            if isinstance(said, Refusal):
                self.answer(route, requests.refused(said))
            elif self.ask is not None:
                self.ask(route, said)


def _authenticator(context: zmq.Context[zmq.Socket[bytes]], keys: Path) -> ThreadAuthenticator:
    door = ThreadAuthenticator(context)
    door.start()
    try:
        door.configure_curve(domain="*", location=str(keys / "authorized"))
    except OSError as error:
        door.stop()
        raise ConfigError(f"cannot read the keys in {keys}: {error.strerror}; make them with 'lacuna keygen'") from None
    return door


def _bind(socket: zmq.Socket[bytes], bind: str, port: int) -> None:
    address = f"{bind}:{port}"
    try:
        socket.bind(address)
    except zmq.ZMQError as error:
        if error.errno == errno.EADDRINUSE:
            line = f"{address} is in use: another lacuna runs here; stop it, or set other ports under [publish]"
            raise PortError(line) from None
        if error.errno == errno.EACCES:
            raise PortError(f"{address}: no permission; set a port above 1023 under [publish]") from None
        raise ConfigError(f"cannot bind {address}: {error.strerror}; set [publish] bind to this machine's") from None
