"""What garbage on the sonar's line costs, and what it can do: from the port to the reading."""

from __future__ import annotations

import os
import random
import threading
import time
import tty
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Final

from config.schema import Config, Recording
from daemon.beams import Beams
from daemon.clock import Clock
from daemon.recorder import Recorder
from drivers.decoders import SONAR_PORT
from drivers.log import LogWriter
from drivers.port import Port
from drivers.readings import Ping
from drivers.tritech.decoder import TritechDecoder
from drivers.tritech.head import Head
from tools.bench.figure import Figure, at_least, at_most
from tools.bench.load import pings

TIMES_REAL: Final = 30.0
GROWTH_MIB: Final = 16.0
_LINE_B_S: Final = 11_520.0
_BYTE_NS: Final = 86_806
_DAMAGED: Final = 0.01
_SINGLY: Final = 5

Kind = Callable[[random.Random, int], bytes]


def _mutated(generator: random.Random, size: int) -> bytes:
    """Return replies of which every one has a few bytes changed, lost or doubled."""
    talk, out = pings(generator.randrange(1000)), bytearray()
    while len(out) < size:
        out += damaged(generator, next(talk))
    return bytes(out[:size])


def damaged(generator: random.Random, frame: bytes) -> bytes:
    """Return ``frame`` with some bytes flipped, and perhaps some dropped or doubled."""
    broken = bytearray(frame)
    for _ in range(generator.randint(1, 8)):
        broken[generator.randrange(len(broken))] ^= 1 << generator.randrange(8)
    at = generator.randrange(len(broken))
    match generator.randrange(3):
        case 0:
            del broken[at : at + generator.choice((1, 3, 50))]
        case 1:
            broken[at:at] = broken[at : at + generator.choice((1, 3, 50))]
    return bytes(broken)


KINDS: Final[dict[str, Kind]] = {
    "random": lambda generator, size: generator.randbytes(size),
    "mutated": _mutated,
    "zeros": lambda _, size: bytes(size),
    "only @": lambda _, size: b"@" * size,
    "lengths": lambda _, size: b"@0FFF" * (size // 5),
    "both lengths": lambda _, size: b"@0FFA\xfa\x0f" * (size // 7),
    "headers": lambda _, size: b"@0FFA\xfa\x0f\x02\x02\x00\x0a\x80\x02" * (size // 13),
    "headers of pings": lambda _, size: b"@0339\x39\x03\x02\xff\x00\x02\x80\x02" * (size // 13),
    "short headers": lambda _, size: b"@0009\x09\x00\x02\xff\x04\x03\x80\x02" * (size // 13),
}
"""Garbage that makes a search for frames work hard, and what lines really carry when they are bad."""


def measure(folder: Path, size: int) -> Iterator[Figure]:
    """Send ``size`` bytes of all kinds together through a pseudo-terminal, record and decode them; see `Figure`."""
    generator, each = random.Random(7), size // len(KINDS)  # noqa: S311  (no secret)
    before_mib, speeds, through = _memory_mib(), {}, 0
    for name, kind in KINDS.items():
        data = kind(generator, each)
        through += len(data)
        speeds[name] = len(data) / _through_port(folder / name.replace(" ", "-"), data) / _LINE_B_S
    worst = min(speeds, key=speeds.__getitem__)
    yield Figure("garbage from port to reading", through / 1e6, "MB", "no exception")
    yield at_least(f"slowest garbage from port to reading ({worst})", speeds[worst], TIMES_REAL, "x real time")
    singly = {name: _byte_by_byte(kind(generator, each // _SINGLY)) for name, kind in KINDS.items()}
    worst = min(singly, key=singly.__getitem__)
    yield at_least(f"slowest garbage byte by byte ({worst})", singly[worst], TIMES_REAL, "x real time")
    yield at_most("memory grown by garbage", _memory_mib() - before_mib, GROWTH_MIB, "MiB")
    yield _recovered(generator, max(size // 2000, 200))


def _through_port(folder: Path, data: bytes) -> float:
    """Return the processor time that ``data`` takes on its way from the port into the log, decoder and head."""
    ours, theirs = os.openpty()
    tty.setraw(theirs)
    port = Port(os.ttyname(theirs), 115200)
    config = Config(recording=Recording(folder=str(folder)))
    beams, head = Beams(config), Head(config.sonar)
    recorder = Recorder(LogWriter(folder, "garbage", config, {}), folder, 0.0, Clock(), lambda _: None)
    talker = threading.Thread(target=_write_all, args=(ours, data), daemon=True)
    talker.start()
    begun_s, received = time.thread_time(), 0
    while received < len(data):
        if piece := port.read():
            received += len(piece)
            chunk = recorder.chunk(SONAR_PORT, "rx", piece)
            beams.push(chunk)
            head.hear(chunk.t_ns, beams.frames)
            recorder.tick(chunk.t_ns)
        else:
            time.sleep(0.0005)
    spent_s = time.thread_time() - begun_s
    talker.join()
    recorder.close()
    port.close()
    os.close(ours)
    os.close(theirs)
    return spent_s


def _write_all(descriptor: int, data: bytes) -> None:
    rest = memoryview(data)
    while rest:
        rest = rest[os.write(descriptor, rest[:4096]) :]


def _byte_by_byte(data: bytes) -> float:
    """Return how many times faster than a line the decoder is where each byte comes alone."""
    decoder = TritechDecoder(Config().sonar)
    begun_s = time.thread_time()
    for at in range(len(data)):
        decoder.push(at * _BYTE_NS, data[at : at + 1])
    return len(data) / (time.thread_time() - begun_s) / _LINE_B_S


def _recovered(generator: random.Random, count: int) -> Figure:
    """Damage one frame in a hundred; all others must be read, with their echoes."""
    talk, decoder = pings(11), TritechDecoder(Config().sonar)
    whole: list[bytes] = []
    read: set[bytes] = set()
    for number in range(count):
        frame = next(talk)
        if generator.random() < _DAMAGED:
            frame = damaged(generator, frame)
        else:
            whole.append(frame[44:-1])
        t_ns = number * len(frame) * _BYTE_NS
        read |= {each.echoes.tobytes() for each in decoder.push(t_ns, frame) if isinstance(each, Ping)}
    read |= {each.echoes.tobytes() for each in decoder.finish() if isinstance(each, Ping)}
    share = sum(echoes in read for echoes in whole) / len(whole)
    return at_least("undamaged frames read beside 1 % damaged ones", share, 1.0, "")


def _memory_mib() -> float:
    lines = Path("/proc/self/status").read_text().splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith("VmRSS")) / 1024
