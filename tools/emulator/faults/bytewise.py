"""What noise and a wrong baud rate make of bytes."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

import numpy as np
from numpy.typing import NDArray

Garble = Callable[[bytes, float, np.random.Generator], bytes]

_IDLE_BITS: Final = 20


def dropped(data: bytes, rate: float, rng: np.random.Generator) -> bytes:
    """Lose each byte with a probability."""
    return _array(data)[rng.random(len(data)) >= rate].tobytes()


def doubled(data: bytes, rate: float, rng: np.random.Generator) -> bytes:
    """Repeat each byte with a probability."""
    return np.repeat(_array(data), 1 + (rng.random(len(data)) < rate)).tobytes()


def flipped(data: bytes, rate: float, rng: np.random.Generator) -> bytes:
    """Flip one bit of each byte with a probability."""
    bits = np.left_shift(1, rng.integers(0, 8, len(data))).astype(np.uint8)
    return (_array(data) ^ np.where(rng.random(len(data)) < rate, bits, 0).astype(np.uint8)).tobytes()


def misread(data: bytes, said_baud: int, heard_baud: int) -> bytes:
    """Return what a receiver at one rate makes of bytes that were sent at another: 8 bits, no parity, one stop bit.

    It waits for the line to fall, then looks at the middle of each bit as it knows it; a byte without a stop bit is
    handed on like any other, as terminals in raw mode do.
    """
    if said_baud == heard_baud or not data:
        return data
    bits = np.zeros((len(data), 10), dtype=np.uint8)
    bits[:, 1:9] = np.unpackbits(_array(data)[:, None], axis=1, bitorder="little")
    bits[:, 9] = 1
    line = np.concatenate([bits.ravel(), np.ones(_IDLE_BITS, dtype=np.uint8)])
    falls = np.flatnonzero((line == 0) & (np.concatenate([[1], line[:-1]]) == 1))
    ratio = said_baud / heard_baud
    middles = (np.arange(8) + 1.5) * ratio
    heard = bytearray()
    free = 0.0
    for fall in falls.tolist():
        if fall >= free:
            looks = np.minimum((fall + middles).astype(np.intp), len(line) - 1)
            heard += np.packbits(line[looks], bitorder="little").tobytes()
            free = fall + 9.5 * ratio
    return bytes(heard)


def _array(data: bytes) -> NDArray[np.uint8]:
    return np.frombuffer(data, dtype=np.uint8)
