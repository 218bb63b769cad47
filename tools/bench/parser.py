"""Time to read a ping, against the library that users of another sonar have: each reads its own protocol.

Both get a ping of 400 echoes; this program in the pieces in which its lines are read, the library byte by byte, for it
takes nothing else.  Install the library with ``pip install '.[peers]'``; without it the comparison is left out.
"""

from __future__ import annotations

import importlib
import time
from collections.abc import Callable, Iterator
from itertools import islice
from types import ModuleType
from typing import Final

from config.schema import Sonar
from drivers.tritech.decoder import TritechDecoder
from tools.bench.figure import Figure, at_least
from tools.bench.load import pings

FASTER: Final = 5.0
_ECHOES: Final = 400
_PIECE: Final = 240
"""Bytes that a line at 115200 baud brings in a round of 20 ms."""
_ROUNDS: Final = 5
_NS_PER_BYTE: Final = 86_806


def measure(messages: int) -> Iterator[Figure]:
    """Read ``messages`` pings with each; see `Figure`."""
    ours_s = _best(_read_ours, b"".join(islice(pings(3, _ECHOES), messages)), messages)
    yield Figure("time to read a ping of 400 echoes", ours_s * 1e6, "us")
    try:
        parser = importlib.import_module("brping.pingmessage")
    except ModuleNotFoundError:
        yield Figure("bluerobotics-ping is not installed: pip install '.[peers]' to compare with it", 0.0, "")
        return

    def read_theirs(line: bytes) -> int:
        reader = parser.PingParser()
        new = parser.PingParser.NEW_MESSAGE
        return sum(reader.parse_byte(byte) == new for byte in line)

    theirs_s = _best(read_theirs, _ping360(parser) * messages, messages)
    yield Figure("the same by bluerobotics-ping, of its own protocol", theirs_s * 1e6, "us")
    yield at_least("faster a message than bluerobotics-ping", theirs_s / ours_s, FASTER, "x")


def _read_ours(line: bytes) -> int:
    decoder = TritechDecoder(Sonar())
    pieces = range(0, len(line), _PIECE)
    return sum(len(decoder.push(at * _NS_PER_BYTE, line[at : at + _PIECE])) for at in pieces)


def _ping360(library: ModuleType) -> bytes:
    ping = library.PingMessage(library.definitions.PING360_DEVICE_DATA)
    for name in ping.payload_field_names:
        setattr(ping, name, 1)
    ping.data_length = ping.number_of_samples = _ECHOES
    ping.data = bytes(number * 7 % 256 for number in range(_ECHOES))
    return bytes(ping.pack_msg_data())


def _best(read: Callable[[bytes], int], line: bytes, messages: int) -> float:
    """Return the processor time of one message in the quickest round: others on the core only ever add to it."""
    spent_s = []
    for _ in range(_ROUNDS):
        begun_s = time.process_time()
        found = read(line)
        spent_s.append(time.process_time() - begun_s)
        if found != messages:
            raise TimeoutError(f"{found} of {messages} messages were read; the comparison means nothing")
    return min(spent_s) / messages
