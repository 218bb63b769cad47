"""The acquisition's promises, measured: garbage, faults, kills, flipped bits, load, and pings per second."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from tools.bench import garbage, kills, line_faults, load, parser, ping_rate
from tools.bench.figure import Figure


@dataclass(frozen=True, slots=True)
class Extent:
    """How much is measured."""

    garbage_bytes: int
    faults: int
    kills: int
    flips: int
    load_s: float
    pings_s: float


_MESSAGES: Final = 2000
FULL: Final = Extent(garbage_bytes=10_000_000, faults=1000, kills=200, flips=400, load_s=20.0, pings_s=20.0)
QUICK: Final = Extent(garbage_bytes=500_000, faults=60, kills=8, flips=60, load_s=4.0, pings_s=4.0)


def measure(extent: Extent) -> Iterator[Figure]:
    """Yield each figure as it is measured; a failure to measure is one too."""
    parts: dict[str, Callable[[Path], Iterator[Figure]]] = {
        "load": lambda folder: load.measure(folder, extent.load_s),
        "ping rate": lambda folder: ping_rate.measure(folder, extent.pings_s),
        "parser": lambda _: parser.measure(_MESSAGES),
        "garbage": lambda folder: garbage.measure(folder, extent.garbage_bytes),
        "faults": lambda folder: line_faults.measure(folder, extent.faults),
        "kills": lambda folder: kills.measure(folder, extent.kills, extent.flips),
    }
    for name, part in parts.items():
        with tempfile.TemporaryDirectory(prefix="lacuna-bench-") as folder:
            try:
                yield from part(Path(folder))
            except TimeoutError as error:
                yield Figure(f"{name}: {error}", 0.0, "", "an end", holds=False)
