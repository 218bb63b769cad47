"""Plans of emulated sites: where their walls are, and whether points lie in the water between them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tools.emulator.rays import Segments
from tools.emulator.site import Wall

Floats = NDArray[np.float64]


def edges(walls: tuple[Wall, ...]) -> tuple[Floats, Floats]:
    pieces = Segments.of(walls)
    return pieces.start, pieces.start + pieces.along


def clearance_m(walls: tuple[Wall, ...], points: Floats) -> Floats:
    """Distance ``(n,)`` of points to the nearest wall."""
    pieces = Segments.of(walls)
    arm = points[:, None] - pieces.start
    share = np.clip((arm * pieces.along).sum(axis=2) / (pieces.along**2).sum(axis=1), 0.0, 1.0)
    distance: Floats = np.linalg.norm(arm - share[..., None] * pieces.along, axis=2).min(axis=1)
    return distance


def inside(wall: Wall, points: Floats) -> NDArray[np.bool_]:
    """Whether points lie inside a closed wall (even-odd rule)."""
    start, end = edges((wall,))
    x, y = points[:, :1], points[:, 1:]
    spans = (start[:, 1] > y) != (end[:, 1] > y)
    with np.errstate(divide="ignore", invalid="ignore"):
        at = start[:, 0] + (y - start[:, 1]) * (end - start)[:, 0] / (end - start)[:, 1]
    return np.asarray((spans & (x < at)).sum(axis=1) % 2 == 1)


def in_water(walls: tuple[Wall, ...], points: Floats) -> bool:
    return bool(inside(walls[0], points).all()) and not any(inside(wall, points).any() for wall in walls[1:])
