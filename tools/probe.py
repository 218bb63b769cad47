"""``lacuna probe PORT``: at which baud rate does who speak there, and what the configuration must say.

It listens first, at every rate.  Only where nothing at all was heard it asks, and only what a silent sonar head
answers (its version), which no other device takes for a command.
"""

from __future__ import annotations

import argparse
import json
import select
import time
from dataclasses import asdict, dataclass, field
from typing import Any, Final

from config.errors import PortError
from drivers.identify import Heard, identify
from drivers.port import Port, list_ports
from drivers.tritech.commands import SendVersion, encode_command

BAUDS: Final = (115200, 57600, 38400, 19200, 9600, 4800)
_NODES: Final = (2, 3, 4)
"""Nodes that sonar heads are given."""
_ANSWER_S: Final = 0.6
_SURE_MESSAGES: Final = 5
_SURE_SHARE: Final = 0.8
_LOOK_S: Final = 0.8
_WAIT_S: Final = 0.05


@dataclass(frozen=True, slots=True)
class Listening:
    """What came at one baud rate, and who understands it, the best first; ``asked``: after a request."""

    baud: int
    bytes: int
    asked: bool
    heard: list[Heard] = field(default_factory=list)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's options."""
    parser.add_argument("port", metavar="PORT", help="a device, socket://HOST:PORT or udp://:PORT")
    parser.add_argument("--seconds", type=_seconds, default=2.5, help="how long to listen at each baud rate (2.5)")
    parser.add_argument("--json", action="store_true", help="print what was found as JSON")


def run(args: argparse.Namespace) -> int:
    """Listen, ask if nothing speaks, and print what was found with its lines for the configuration."""
    tried = probe(args.port, args.seconds)
    best = max(tried, key=lambda each: (each.heard[0].share if each.heard else 0.0, each.bytes), default=None)
    found = best.heard[0] if best and best.heard else None
    if args.json:
        print(json.dumps(_body(args.port, tried, best if found else None)))
    elif best and found:
        print(f"{args.port} at {best.baud} baud: {found.says}")
        print(f"  {_counts(found)}; {found.share:.0%} of {best.bytes} bytes understood")
        for other in best.heard[1:]:
            print(f"  less likely: {other.says}")
        print("\n" + toml(args.port, best.baud, found))
    if found is None:
        raise PortError(_nothing(args.port, tried))
    return 0


def probe(url: str, seconds: float) -> list[Listening]:
    """Return what came at each baud rate that was tried; ends early where somebody is surely understood.

    Raises PortError where the port cannot be opened.
    """
    tried: list[Listening] = []
    bauds = BAUDS if "://" not in url else BAUDS[:1]
    for baud in bauds:
        tried.append(_listen(url, baud, seconds, b""))
        if _is_sure(tried[-1].heard):
            return tried
    if any(each.bytes for each in tried) or url.startswith("udp:"):
        return tried
    question = b"".join(encode_command(SendVersion(), node) for node in _NODES)
    for baud in bauds:
        tried.append(_listen(url, baud, min(seconds, _ANSWER_S), question))
        if tried[-1].heard:
            break
    return tried


def toml(url: str, baud: int, heard: Heard) -> str:
    """Return the lines of the configuration for what was heard."""
    settings: dict[str, Any] = {"port": _staying_name(url), "baud": baud} | heard.settings
    head = "[sonar]" if heard.section == "sonar" else "[[feed]]"
    advice = [f"# {heard.advice}"] if heard.advice else []
    return "\n".join([head, *(f"{key} = {json.dumps(value)}" for key, value in settings.items()), *advice])


def _listen(url: str, baud: int, seconds: float, question: bytes) -> Listening:
    port = Port(url, baud)
    try:
        if question:
            port.write(question)
        pieces = _pieces(port, seconds)
    finally:
        port.close()
    return Listening(baud, sum(len(data) for _, data in pieces), bool(question), identify(pieces))


def _pieces(port: Port, seconds: float) -> list[tuple[int, bytes]]:
    pieces: list[tuple[int, bytes]] = []
    end_s = time.monotonic() + seconds
    look_s = time.monotonic() + _LOOK_S
    while (now_s := time.monotonic()) < end_s:
        _wait(port)
        data = port.read()
        if data:
            pieces.append((time.monotonic_ns(), data))
        if now_s >= look_s and pieces:
            look_s = now_s + _LOOK_S
            if _is_sure(identify(pieces)):
                break
    return pieces


def _wait(port: Port) -> None:
    descriptor = port.fileno()
    if descriptor is None:
        time.sleep(_WAIT_S)
    else:
        select.select([descriptor], [], [], _WAIT_S)


def _is_sure(heard: list[Heard]) -> bool:
    return any(sum(each.messages.values()) >= _SURE_MESSAGES and each.share >= _SURE_SHARE for each in heard)


def _staying_name(url: str) -> str:
    names = {info.device: info.by_id for info in list_ports()}
    return names.get(url) or url


def _counts(heard: Heard) -> str:
    return ", ".join(f"{count} {name}" for name, count in sorted(heard.messages.items()))


def _body(url: str, tried: list[Listening], best: Listening | None) -> dict[str, Any]:
    found = None if best is None else {"baud": best.baud} | asdict(best.heard[0])
    lines = None if best is None else toml(url, best.baud, best.heard[0])
    return {"port": url, "found": found, "toml": lines, "tried": [asdict(each) for each in tried]}


def _nothing(url: str, tried: list[Listening]) -> str:
    loudest = max(tried, key=lambda each: each.bytes)
    if loudest.bytes:
        much = f"{loudest.bytes} bytes at {loudest.baud} baud"
        return f"{url} speaks, but nothing that lacuna knows ({much}); see the device's manual"
    hint = "check power and cable; a Pro 4 vehicle or a Keller sensor speaks only when polled (poll = true)"
    return f"{url} is silent; {hint}"


def _seconds(text: str) -> float:
    try:
        seconds = float(text)
    except ValueError:
        seconds = 0.0
    if not 0.1 <= seconds <= 600:
        raise argparse.ArgumentTypeError(f"{text} is not a time from 0.1 to 600 s")
    return seconds
