"""A whole dive in simulated time: what a host would have recorded, in seconds instead of minutes."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from config.errors import LogError
from config.schema import Sonar
from drivers.tritech.head import Head
from tools.emulator.dive import Dive

TICK_NS: Final = 10_000_000
"""How often the host reads its ports: 10 ms, as a kernel hands bytes over."""

TAIL_NS: Final = 3_000_000_000
"""How long a recording goes on after the dive is done: nobody pulls the plug at once."""

_GIVE_UP_NS: Final = 4 * 3600 * 1_000_000_000


@dataclass(frozen=True, slots=True)
class Piece:
    """Bytes that went over a port at a time: ``rx`` to the host, ``tx`` from it."""

    t_ns: int
    port: str
    direction: str
    data: bytes


def record(dive: Dive, sonar: Sonar | None = None) -> Iterator[Piece]:
    """Yield what goes over both ports (``sonar`` and ``feed``) until the dive is done, or for four hours.

    The host is the one that drives real heads; ``sonar`` is its configuration.
    """
    host = Head(sonar or Sonar())
    t_ns, end_ns = 0, _GIVE_UP_NS
    while t_ns < end_ns:
        t_ns += TICK_NS
        from_sonar, from_feed = dive.tick(t_ns)
        if from_feed:
            yield Piece(t_ns, "feed", "rx", from_feed)
        if from_sonar:
            yield Piece(t_ns, "sonar", "rx", from_sonar)
        if asked := host.push(t_ns, from_sonar) if from_sonar else host.tick(t_ns):
            yield Piece(t_ns, "sonar", "tx", asked)
            dive.push(t_ns, asked)
        if dive.advance(t_ns) and dive.done:
            end_ns = t_ns + TAIL_NS


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
