"""Floor plans drawn by chance: rooms with straight walls and doors, turned by any angle, walls thin or thick.

Maps of robots have few clean corners and many ragged ones; built places have both.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Final

import numpy as np
from numpy.typing import NDArray

from mapping.values import FREE, OCCUPIED, UNKNOWN

_SIDE: Final = 220
_SMALLEST: Final = 28.0  # cells: a room that is narrower is not parted
_DOOR: Final = (6.0, 16.0)
_DOORLESS: Final = 0.25

Segment = tuple[float, float, float, float]
Layer = NDArray[np.float64]


def drawn_rooms(count: int, random: np.random.Generator) -> Iterator[tuple[str, NDArray[np.uint8]]]:
    """Yield ``count`` plans by name, state layers ``(rows, cols)``."""
    for number in range(count):
        yield f"rooms-{number}", _plan(random)


def _plan(random: np.random.Generator) -> NDArray[np.uint8]:
    width, height = random.uniform(90.0, 150.0, 2)
    walls = [*_outline(width, height), *_parted(0.0, 0.0, width, height, random)]
    turn, half = random.uniform(0.0, math.tau), random.uniform(0.6, 2.2)
    rows, cols = np.indices((_SIDE, _SIDE)) - _SIDE / 2
    u = cols * math.cos(turn) + rows * math.sin(turn) + width / 2
    v = rows * math.cos(turn) - cols * math.sin(turn) + height / 2
    inside = (u > 0) & (u < width) & (v > 0) & (v < height)
    state = np.where(inside, FREE, UNKNOWN).astype(np.uint8)
    for wall in walls:
        state[_from(wall, u, v) <= half] = OCCUPIED
    return state


def _outline(width: float, height: float) -> list[Segment]:
    corners = [(0.0, 0.0), (width, 0.0), (width, height), (0.0, height)]
    return [(*a, *b) for a, b in zip(corners, [*corners[1:], corners[0]], strict=True)]


def _parted(x: float, y: float, width: float, height: float, random: np.random.Generator) -> list[Segment]:
    """Walls that part a room, each with a door or none, until the rooms are small."""
    if max(width, height) < 2 * _SMALLEST or min(width, height) < _SMALLEST:
        return []
    share = random.uniform(0.35, 0.65)
    if width >= height:
        at = x + share * width
        wall = [(at, y + a, at, y + b) for a, b in _around_door(height, random)]
        return wall + _parted(x, y, at - x, height, random) + _parted(at, y, x + width - at, height, random)
    at = y + share * height
    wall = [(x + a, at, x + b, at) for a, b in _around_door(width, random)]
    return wall + _parted(x, y, width, at - y, random) + _parted(x, at, width, y + height - at, random)


def _around_door(length: float, random: np.random.Generator) -> list[tuple[float, float]]:
    if random.random() < _DOORLESS:
        return [(0.0, length)]
    door = random.uniform(*_DOOR)
    start = random.uniform(0.15, 0.85) * (length - door)
    return [(0.0, start), (start + door, length)]


def _from(wall: Segment, u: Layer, v: Layer) -> Layer:
    """Distance of every cell from a wall."""
    x0, y0, x1, y1 = wall
    length = max(math.hypot(x1 - x0, y1 - y0), 1e-9)
    along = np.clip(((u - x0) * (x1 - x0) + (v - y0) * (y1 - y0)) / length**2, 0.0, 1.0)
    return np.hypot(u - x0 - along * (x1 - x0), v - y0 - along * (y1 - y0))
