"""``lacuna dashboard``: the live page in a browser."""

from __future__ import annotations

import argparse
import socket
import webbrowser
from pathlib import Path
from urllib.parse import quote

from config.checks import is_loopback
from config.errors import ConfigError, PortError, UsageError

_LAPTOP = ("starlette", "uvicorn", "websockets", "plotly", "anyio")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("--connect", default="tcp://127.0.0.1:5556", metavar="ADDRESS", help="the daemon's snapshots")
    parser.add_argument("--requests", default="tcp://127.0.0.1:5557", metavar="ADDRESS", help="the daemon's requests")
    parser.add_argument("--host", default="127.0.0.1", help="address to listen on; any but loopback needs --token")
    parser.add_argument("--port", type=int, default=8080, help="0 takes a free one")
    parser.add_argument("--open", action="store_true", help="open the page in the browser")
    parser.add_argument("--keys", metavar="DIR", help="folder of CURVE keys for a daemon on another machine")
    parser.add_argument("--token", help="secret word that people from other machines must know")


def run(args: argparse.Namespace) -> int:
    """Serve the page until Ctrl-C."""
    try:
        from tools.dashboard.access import Access
        from tools.dashboard.peer import Peer, curve_from
        from tools.dashboard.server import application, serve
    except ModuleNotFoundError as error:
        if (error.name or "").split(".")[0] not in _LAPTOP:
            raise
        raise ConfigError(f"the live page needs the package '{error.name}'; pip install 'lacuna[laptop]'") from None
    if args.token is None and not is_loopback(args.host):
        raise ConfigError(f"{args.host} can be reached from other machines: give --token WORD, or leave --host away")
    if args.token is not None and len(args.token) < 8:
        raise UsageError("the token is too short: take 8 characters or more")
    if not 0 <= args.port <= 65535:
        raise UsageError(f"there is no port {args.port}; give --port 1 to 65535, or 0 for a free one")
    keys = curve_from(Path(args.keys).expanduser()) if args.keys is not None else None
    peer = Peer(args.connect, args.requests, keys)
    peer.check()
    with listen(args.host, args.port) as listener:
        address = url(args.host, listener.getsockname()[1], args.token)
        print(f"dashboard: {address}", flush=True)
        if args.open:
            webbrowser.open(address)
        serve(application(peer, Access(args.token)), listener)
    return 0


def listen(host: str, port: int) -> socket.socket:
    """Return a TCP socket that is bound to ``host`` and ``port``; raises PortError where it cannot be."""
    try:
        kind, _, _, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE)[0]
        listener = socket.socket(kind, socket.SOCK_STREAM)
    except OSError as error:
        raise PortError(f"cannot listen on {host} port {port} ({error}); choose another --host") from None
    try:
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listener.bind(address)
        listener.listen()
    except OSError as error:
        listener.close()
        raise PortError(f"cannot listen on {host} port {port} ({error.strerror}); choose another with --port") from None
    return listener


def url(host: str, port: int, token: str | None) -> str:
    """Return the address people type; with a token, the one that lets them in."""
    name = f"[{host}]" if ":" in host else host
    return f"http://{name}:{port}/" + (f"?token={quote(token, safe='')}" if token else "")
