"""What is seen beside ways and the walls that they join, looking square to both sides."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fill.freedom import at
from fill.scene import FARTHEST
from fill.segments import End
from fill.ways import Way
from mapping.values import FREE, OCCUPIED, UNKNOWN

PLACES: Final = 12
"""Places along a way that are looked from."""
_BEHIND: Final = (2, 4, 7)  # cells behind an end: what its wall has at its sides
NEAREST: Final = len(_BEHIND)
"""Places on either wall that are looked from."""
_OFF: Final = np.arange(1.0, FARTHEST + 1.0)
_DENSE: Final = np.arange(4)  # cells of water in a row that are water and not a stray ray
_BOTH: Final = np.array([1.0, -1.0])[:, None, None]

Layer = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Beside:
    """What is seen from places along ``n`` ways and their walls, square to them, over ``FARTHEST`` cells off the face.

    ``seen`` ``(n, 2, places, cells)`` uint8; ``away`` ``(n, 2, places)`` cells to the first that is not unknown;
    ``water`` and ``wall`` ``(n, 2, places)`` bool tell what that is.  The first ``PLACES`` lie on the way, then
    ``NEAREST`` behind either end.
    """

    seen: NDArray[np.uint8]
    away: NDArray[np.int64]
    water: NDArray[np.bool_]
    wall: NDArray[np.bool_]


def look_beside(
    ways: Sequence[Way], points: Layer, first: NDArray[np.int64], last: NDArray[np.int64], state: NDArray[np.uint8]
) -> Beside:
    """Look from ways whose curves are ``points`` ``(m, 2)``, each from ``first`` ``(n,)`` to ``last`` ``(n,)``."""
    places, ahead = _looks(ways, points, first, last)
    off = _OFF + np.array([max((way.ends[0].half + way.ends[1].half) / 2.0 - 0.5, 0.0) for way in ways])[:, None]
    lateral = _BOTH * off[:, None, None, :]
    x = places[:, None, :, None, 0] - lateral * ahead[:, None, :, None, 1]
    y = places[:, None, :, None, 1] + lateral * ahead[:, None, :, None, 0]
    seen = at(state, x, y)
    known = seen != UNKNOWN
    away = np.where(known.any(axis=3), known.argmax(axis=3), len(_OFF))
    run = np.take_along_axis(seen, np.minimum(away[..., None] + _DENSE, len(_OFF) - 1), axis=3)
    water = (run[..., 0] == FREE) & (np.mean(run == FREE, axis=3) > 0.6)
    return Beside(seen, away, water, run[..., 0] == OCCUPIED)


def _looks(
    ways: Sequence[Way], points: Layer, first: NDArray[np.int64], last: NDArray[np.int64]
) -> tuple[Layer, Layer]:
    """Places ``(n, p, 2)`` that are looked from, and the unit direction of way or wall at each."""
    steps = (np.arange(PLACES) * ((last - first) / (PLACES - 1))[:, None]).astype(np.int64)
    steps[:, -1] = last - first
    places = points[first[:, None] + steps]
    ahead = np.gradient(places, axis=1)
    side = np.array([way.side for way in ways])[:, None, None]
    near = _behind([way.ends[0] for way in ways], 1.0)
    beyond = _behind([way.ends[1] for way in ways], -1.0)
    met = places[:, -1:], ahead[:, -1:]
    places, ahead = (
        np.concatenate([mine, here, np.where(side, end, there)], axis=1)
        for mine, here, there, end in zip((places, ahead), near, beyond, met, strict=True)
    )
    return places, ahead / np.maximum(np.hypot(ahead[..., 0], ahead[..., 1]), 1e-9)[..., None]


def _behind(ends: Sequence[End], sign: float) -> tuple[Layer, Layer]:
    """Places ``(n, k, 2)`` on the walls behind ends, and their directions there."""
    places = np.stack([end.line[np.minimum(_BEHIND, len(end.line) - 1)] for end in ends])
    aims = np.array([(end.dx * sign, end.dy * sign) for end in ends])
    return places, np.repeat(aims[:, None], NEAREST, axis=1)
