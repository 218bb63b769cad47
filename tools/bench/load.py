"""What the acquisition costs with all its lines saturated: time to start, memory, processor."""

from __future__ import annotations

import random
import time
from collections.abc import Iterator
from pathlib import Path
from statistics import median
from typing import Final

from config.schema import Sonar
from drivers.tritech import units
from drivers.tritech.headdata import USUAL_CONTROL, Control, HeadData, encode_head_data
from tools.bench.acq_rig import Rig
from tools.bench.figure import Figure, at_least, at_most

READY_S: Final = 0.6
MEMORY_MIB: Final = 60.0
CPU_PCT: Final = 6.0
FEEDS: Final = {"compass": 4800, "depth": 38400}
_PIECE_S: Final = 0.005
"""How often a serial adapter hands over what has come: a packet of some 60 bytes at 115200 baud."""

_WINDOW_S: Final = 2.0
_STARTS: Final = 5
_BYTE_S: Final = 10.0


def pings(seed: int, bins: int = 400) -> Iterator[bytes]:
    """Yield replies of a head that goes round and round, with noise for echoes."""
    generator, bearing = random.Random(seed), 0  # noqa: S311  (no secret)
    interval, bins = units.sampling(10.0, bins, Sonar().sound_speed_m_s)
    while True:
        bearing = (bearing + 32) % units.TURN
        control = USUAL_CONTROL | Control.CONTINUOUS
        yield encode_head_data(
            HeadData(bearing, generator.randbytes(bins), interval, 32, 0, 0, control=control, range_scale=100, gain=105)
        )


def sentences(seed: int) -> Iterator[bytes]:
    """Yield sentences of compass and depth."""
    generator = random.Random(seed)  # noqa: S311  (no secret)
    while True:
        body = f"HCHDT,{generator.uniform(0, 359.9):.1f},T"
        if generator.random() < 0.5:
            body = f"SDDPT,{generator.uniform(0, 20):.2f},0.0"
        checksum = 0
        for byte in body.encode():
            checksum ^= byte
        yield f"${body}*{checksum:02X}\r\n".encode()


class Source:
    """The bytes of an endless talker, at the pace of its line."""

    def __init__(self, talk: Iterator[bytes], baud: int) -> None:
        self._talk = talk
        self._rate = baud / _BYTE_S
        self._rest = b""
        self._owed = 0.0

    def after(self, seconds: float) -> bytes:
        """Return what has come over the line in ``seconds`` more."""
        self._owed += seconds * self._rate
        count = int(self._owed)
        self._owed -= count
        while len(self._rest) < count:
            self._rest += next(self._talk)
        data, self._rest = self._rest[:count], self._rest[count:]
        return data


def measure(folder: Path, seconds: float) -> Iterator[Figure]:
    """Start the acquisition a few times, then saturate its lines for ``seconds``."""
    ready_s = []
    for number in range(_STARTS):
        place = folder / str(number)
        place.mkdir()
        with Rig(place, FEEDS) as rig:
            ready_s.append(rig.start().ready_s)
            rig.stop()
    yield at_most("ready to read, best of five starts", min(ready_s), READY_S, "s")
    with Rig(folder, FEEDS) as rig:
        rig.start()
        yield from _saturate(rig, seconds)
        rig.stop()


def _saturate(rig: Rig, seconds: float) -> Iterator[Figure]:
    sources = {name: Source(sentences(number), baud) for number, (name, baud) in enumerate(FEEDS.items())}
    sources["sonar"] = Source(pings(1), Sonar().baud)
    feed(rig, sources, 1.0)
    begun_s, pings_before, cpu_pct = time.monotonic(), rig.told["ping"], []
    while time.monotonic() - begun_s < seconds:
        before_s, since_s = rig.cpu_s(), time.monotonic()
        feed(rig, sources, _WINDOW_S)
        cpu_pct.append(100 * (rig.cpu_s() - before_s) / (time.monotonic() - since_s))
    passed_s = time.monotonic() - begun_s
    # Another program on the same core only ever adds to what this one seems to take.
    yield at_most("processor with all lines saturated, best 2 s", min(cpu_pct), CPU_PCT, "% of a core")
    yield Figure("processor with all lines saturated, median", median(cpu_pct), "% of a core")
    yield at_most("memory with all lines saturated", rig.memory_mib(), MEMORY_MIB, "MiB")
    heard = (rig.told["ping"] - pings_before) / (passed_s * Sonar().baud / _BYTE_S / 445)
    yield at_least("pings published of those sent", heard, 0.98, "")


def feed(rig: Rig, sources: dict[str, Source], seconds: float) -> None:
    """Let all lines talk for ``seconds``."""
    begun_s = last_s = time.monotonic()
    while (now_s := time.monotonic()) - begun_s < seconds:
        for name, source in sources.items():
            rig.wires[name].write(source.after(now_s - last_s))
            rig.wires[name].read()
        last_s = now_s
        rig.listen()
        time.sleep(_PIECE_S)
