"""A whole dive in simulated time: what a host would have recorded, in seconds instead of minutes."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from config.errors import LogError
from config.schema import Sonar
from drivers.tritech.commands import SendBBUser, SendData, SendVersion, encode_command
from drivers.tritech.framing import Deframer
from drivers.tritech.headdata import HeadData
from drivers.tritech.messages import Alive, BBUserData, HeadInf, VersionData, decode
from drivers.tritech.settings import head_command
from tools.emulator.dive import Dive

TICK_NS: Final = 10_000_000
"""How often the host reads its ports: 10 ms, as a kernel hands bytes over."""

_ASK_AGAIN_NS: Final = 1_000_000_000
_GIVE_UP_NS: Final = 4 * 3600 * 1_000_000_000


@dataclass(frozen=True, slots=True)
class Piece:
    """Bytes that went over a port at a time: ``rx`` to the host, ``tx`` from it."""

    t_ns: int
    port: str
    direction: str
    data: bytes


def record(dive: Dive, sonar: Sonar | None = None) -> Iterator[Piece]:
    """Yield what goes over both ports (``sonar`` and ``feed``) until the dive is done, or after four hours."""
    host = _Host(sonar or Sonar())
    t_ns = 0
    while not dive.done and t_ns < _GIVE_UP_NS:
        t_ns += TICK_NS
        from_sonar, from_feed = dive.tick(t_ns)
        if from_feed:
            yield Piece(t_ns, "feed", "rx", from_feed)
        if from_sonar:
            yield Piece(t_ns, "sonar", "rx", from_sonar)
        if asked := host.step(t_ns, from_sonar):
            yield Piece(t_ns, "sonar", "tx", asked)
            dive.push(t_ns, asked)
        dive.advance(t_ns)


def write_jsonl(pieces: Iterable[Piece], path: Path) -> int:
    """Write pieces as JSON lines and return their number.

    Raises LogError where the file cannot be written.
    """
    count = 0
    try:
        with path.open("w", encoding="ascii") as file:
            for piece in pieces:
                line = {"t_ns": piece.t_ns, "port": piece.port, "dir": piece.direction, "hex": piece.data.hex()}
                file.write(json.dumps(line) + "\n")
                count += 1
    except OSError as error:
        raise LogError(f"cannot write {path}: {error.strerror}; choose another file or free some space") from None
    return count


class _Host:
    """The least that makes a head scan: wait until it is centred, greet it, set it, keep asking."""

    def __init__(self, sonar: Sonar) -> None:
        self._sonar = sonar
        self._deframer = Deframer(sonar.baud)
        self._stage = "centring"
        self._asked_ns = 0
        self._replies = 0

    def step(self, t_ns: int, data: bytes) -> bytes:
        out = bytearray()
        for frame in self._deframer.push(t_ns, data):
            match decode(frame):
                case Alive(info) if self._stage == "centring" and HeadInf.CENTRED in info:
                    self._stage = "greeting"
                    out += encode_command(SendVersion(), self._sonar.node)
                case VersionData():
                    out += encode_command(SendBBUser(), self._sonar.node)
                case BBUserData():
                    out += encode_command(head_command(self._sonar), self._sonar.node)
                case Alive(info) if self._stage == "greeting" and HeadInf.NO_PARAMETERS not in info:
                    self._stage = "asking"
                    out += self._ask(t_ns)
                case HeadData():
                    self._replies += 1
                    if self._replies % 2 == 0:
                        out += self._ask(t_ns)
        if self._stage == "asking" and t_ns - self._asked_ns > _ASK_AGAIN_NS:
            out += self._ask(t_ns)
        return bytes(out)

    def _ask(self, t_ns: int) -> bytes:
        self._asked_ns = t_ns
        return encode_command(SendData(), self._sonar.node)
