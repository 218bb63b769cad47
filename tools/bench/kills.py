"""Two hundred deaths at random moments, and four hundred flipped bits: what is recorded stays, and nothing false."""

from __future__ import annotations

import random
import time
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import accumulate
from pathlib import Path
from typing import Final

from config.schema import Config, Sonar
from drivers.log import Damage, LogWriter, read_log
from drivers.records import Chunk, Record
from tools.bench.acq_rig import SESSION, Rig
from tools.bench.figure import Figure, at_most
from tools.bench.load import Source, pings, sentences

LOST_S: Final = 0.3
_LIFE_S: Final = (0.02, 0.9)
_FEEDS: Final = {"compass": 4800}
_PIECE_S: Final = 0.005
_CHUNKS: Final = 40
_UTC_NS: Final = 1_700_000_000_000_000_000


@dataclass(slots=True)
class Life:
    """One run of the process: what each port delivered and when, and when it was killed."""

    pieces: dict[str, list[tuple[float, bytes]]]
    killed_s: float

    def oldest_loss_s(self, port: str, received: bytes) -> float | None:
        """Return how long before the kill the first byte that is missing was delivered; 0 where none is missing.

        None where ``received`` is not what was sent: a wrong byte.
        """
        sent = b"".join(data for _, data in self.pieces[port])
        if not sent.startswith(received):
            return None
        ends = accumulate(len(data) for _, data in self.pieces[port])
        for (at_s, _), end in zip(self.pieces[port], ends, strict=True):
            if end > len(received):
                return self.killed_s - at_s
        return 0.0


def kill_often(folder: Path, kills: int) -> Iterator[Figure]:
    """Start, record, ``kill -9`` and start again, ``kills`` times in one session; see `Figure`."""
    generator = random.Random(3)  # noqa: S311  (no secret)
    sources = {"sonar": Source(pings(2), Sonar().baud), "compass": Source(sentences(2), _FEEDS["compass"])}
    with Rig(folder, _FEEDS) as rig:
        lives = []
        for _ in range(kills):
            rig.start()
            lives.append(_live(rig, sources, generator.uniform(*_LIFE_S)))
        rig.start()
        rig.listen(0.3)
        rig.stop()
        yield from _judge_kills(rig, lives)


def flip_often(folder: Path, flips: int) -> Iterator[Figure]:
    """Flip one bit of a log, ``flips`` times; see `Figure`."""
    records, path = _small_log(folder)
    whole, generator = path.read_bytes(), random.Random(4)  # noqa: S311  (no secret)
    most, wrong, lost = _records_per_chunk(len(records)), 0, 0
    for _ in range(flips):
        broken = bytearray(whole)
        broken[generator.randrange(len(broken))] ^= 1 << generator.randrange(8)
        path.write_bytes(broken)
        read = list(read_log(path, Damage()))
        wrong += not _is_part(read, records)
        lost = max(lost, len(records) - len(read))
    yield at_most(f"logs with a wrong record after {flips} flips of a bit", wrong, 0, "")
    yield at_most("records lost by a flipped bit, at worst", lost, most, f"of a chunk's {most}")


def _live(rig: Rig, sources: dict[str, Source], seconds: float) -> Life:
    pieces: dict[str, list[tuple[float, bytes]]] = {name: [] for name in sources}
    begun_s = last_s = time.monotonic()
    while (now_s := time.monotonic()) - begun_s < seconds:
        for name, source in sources.items():
            data = source.after(now_s - last_s)
            count = rig.wires[name].write(data)
            pieces[name].append((time.monotonic(), data[:count]))
            rig.wires[name].read()
        last_s = now_s
        rig.listen()
        time.sleep(_PIECE_S)
    killed_s = time.monotonic()
    rig.kill()
    return Life(pieces, killed_s)


def _judge_kills(rig: Rig, lives: list[Life]) -> Iterator[Figure]:
    files = sorted(rig.logs.glob(f"{SESSION}-*"))
    wrong, oldest_s = 0, 0.0
    for life, path in zip(lives, files, strict=False):
        records = list(read_log(path))
        for port in life.pieces:
            received = b"".join(_rx(each, port) for each in records)
            loss_s = life.oldest_loss_s(port, received)
            wrong += loss_s is None
            oldest_s = max(oldest_s, loss_s or 0.0)
    yield Figure("segments after kills", float(len(files)), "", f"{len(lives) + 1}", len(files) == len(lives) + 1)
    yield at_most("oldest byte lost by a kill -9", oldest_s, LOST_S, "s before it")
    yield at_most("runs with a wrong byte", wrong, 0, "")


def _rx(record: Record, port: str) -> bytes:
    if isinstance(record, Chunk) and record.port == port and record.direction == "rx":
        return record.data
    return b""


def _small_log(folder: Path) -> tuple[list[Record], Path]:
    talk, records = pings(6, bins=100), list[Record]()
    with LogWriter(folder, "flips", Config(), {}) as log:
        for number in range(20 * _CHUNKS):
            records.append(Chunk(number, _UTC_NS + number, "sonar", "rx", next(talk)))
            log.write(records[-1])
            if number % 20 == 19:
                log.flush()
    return records, log.path


def _records_per_chunk(count: int) -> int:
    return count // _CHUNKS


def _is_part(read: list[Record], records: list[Record]) -> bool:
    """Tell whether ``read`` is ``records`` with some left out."""
    rest = iter(records)
    return all(any(each == other for other in rest) for each in read)


def measure(folder: Path, kills: int, flips: int) -> Iterator[Figure]:
    """Both figures, in folders of their own below ``folder``."""
    (folder / "kills").mkdir()
    yield from kill_often(folder / "kills", kills)
    yield from flip_often(folder / "flips", flips)
