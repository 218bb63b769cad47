"""What filling costs on large grids that no site gives: 2,000 x 2,000 cells, in processor time of one core."""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import Final

import numpy as np
from numpy.typing import NDArray

from config.schema import Fill
from fill.filler import Filler
from mapping.values import FREE, OCCUPIED, UNKNOWN, Grid
from tools.bench.figure import Figure

_SIDE: Final = 2000


def measure(seed: int) -> Iterator[Figure]:
    """Yield the figures."""
    random = np.random.default_rng(seed)
    grids = {
        "nothing": np.full((_SIDE, _SIDE), UNKNOWN, np.uint8),
        "all wall": np.full((_SIDE, _SIDE), OCCUPIED, np.uint8),
        "one wall": _one_wall(),
        "noise, 5 % wall": _noise(0.05, random),
        "noise, 50 % wall": _noise(0.5, random),
    }
    for name, state in grids.items():
        start = time.process_time()
        filled = Filler(Fill()).update(Grid(0.05, 0.0, 0.0, np.zeros(state.shape, np.float32), state))
        seconds = time.process_time() - start
        yield Figure(f"fill 2,000 x 2,000 cells of {name}; {len(filled.holes)} holes", seconds, "s")


def _one_wall() -> NDArray[np.uint8]:
    state = np.full((_SIDE, _SIDE), UNKNOWN, np.uint8)
    state[1000:1003, 100:1900] = OCCUPIED
    state[1003:1400, 100:1900] = FREE
    state[1000:1003, 900:910] = UNKNOWN
    return state


def _noise(share: float, random: np.random.Generator) -> NDArray[np.uint8]:
    """Cells by chance: a share of wall, a third of the others water."""
    draw = random.random((_SIDE, _SIDE))
    state = np.where(draw < share + (1.0 - share) / 3.0, FREE, UNKNOWN).astype(np.uint8)
    state[draw < share] = OCCUPIED
    return state
