"""What speaks for a fill and for each of its cells, once it is drawn: what stands near, and what else was possible.

A cell next to measured wall, or to water that was seen to end, is right whatever curve was taken; deep in the unknown
everything hangs on the curve and on the match.  Where every plausible curve between two ends passes, the cell is surer
than where they part.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.spatial import cKDTree

from fill.candidates import FEATURES
from fill.closing import Closed
from fill.curves import chord, curves, straight
from fill.freedom import at
from fill.segments import End, cell_at
from mapping.values import FREE, OCCUPIED, UNKNOWN

HOLE_FEATURES: Final = (
    *FEATURES, "log-odds", "rival", "parting", "apart", "walled in",
    "faces both", "faces one", "shore near", "shore far", "unseen within", "unseen about",
)  # fmt: skip
"""What a whole fill is judged by: its candidate's features, and how it stands among the others."""

CELL_FEATURES: Final = (
    "touches wall",
    "near wall",
    "log wall",
    "log away",
    "share",
    "touches water",
    "close to water",
    "log to water",
    "water at both",
    "rim",
    "log spread",
    "agreed",
    "rivals agree",
)
"""What a cell is judged by beside its hole, in this order."""

_FAR: Final = 12.0  # cells: further is all the same
_SAME: Final = 1.5  # cells between two curves that pass the same cells
SEEN: Final = 14
"""Cells about a fill, beside the length of its gap, that witnesses look at."""
_MARGIN: Final = 13
_CLEARLY: Final = 1.5


def witness(closed: Closed, state: NDArray[np.uint8]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return features ``(h,)`` of a fill, after ``HOLE_FEATURES``, and ``(n, c)`` of its cells after ``CELL_FEATURES``.

    ``state`` ``(rows, cols)`` is what was measured.
    """
    spread = _spread(closed)
    cells = _cell_features(closed, state, spread)
    candidate = closed.candidate
    chance = min(max(closed.chance, 1e-3), 1.0 - 1e-3)
    rival = max((each for _, each in closed.rivals), default=0.0)
    own = np.array(
        [
            np.log(chance / (1.0 - chance)),
            rival,
            float(np.log1p(spread.max(initial=0.0))),
            float(np.log1p(spread.mean(axis=1).max(initial=0.0))),
            float(np.mean(cells[:, CELL_FEATURES.index("touches wall")])),
        ]
    )
    return np.concatenate([candidate.features, own, _about(closed, state)]), cells


def distances(closed: Closed, cells: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the distance ``(n,)`` of a fill's cells from what was measured, by which its certainty falls.

    That is the nearer end, and measured wall inside the hole where it is clearly nearer; ``cells`` are the features.
    """
    wall = np.exp(cells[:, CELL_FEATURES.index("log wall")])
    half = max(closed.candidate.half_a, closed.candidate.half_b)
    return np.where(wall + half + _CLEARLY < closed.away, wall, closed.away)


def _about(closed: Closed, state: NDArray[np.uint8]) -> NDArray[np.float64]:
    """Tell what was seen about a hole: water before its ends, water to its sides, and how much is unseen."""
    a, b = closed.candidate.ends
    faces = sorted(_face(end, state) for end in (a, b))
    gap = max(closed.candidate.gap, 2.0)
    along = np.array([b.x - a.x, b.y - a.y]) / max(float(np.hypot(b.x - a.x, b.y - a.y)), 1e-9)
    middle = np.array([a.x + b.x, a.y + b.y]) / 2.0
    off = np.arange(0.0, gap + 4.0)
    shores = []
    for sign in (1.0, -1.0):
        found = at(state, middle[0] - sign * off * along[1], middle[1] + sign * off * along[0]) == FREE
        shores.append(float(off[np.argmax(found)]) / gap if found.any() else 1.5)
    ring = np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False)
    unseen = []
    for share in (0.3, 0.7):
        circle = middle[:, None] + share * gap * np.stack([np.cos(ring), np.sin(ring)])
        unseen.append(float(np.mean(at(state, circle[0], circle[1]) == UNKNOWN)))
    return np.array([faces[0], faces[1] - faces[0], min(shores), max(shores), *unseen])


def _face(end: End, state: NDArray[np.uint8]) -> float:
    """Return the share of water close before the face of an end."""
    ahead, aside = np.meshgrid(np.arange(0.0, 4.0), np.arange(-3.0, 4.0) * (end.half + 2.0) / 3.0)
    seen = at(state, end.x + ahead * end.dx - aside * end.dy, end.y + ahead * end.dy + aside * end.dx)
    return float(np.mean(seen == FREE))


def _cell_features(closed: Closed, state: NDArray[np.uint8], spread: NDArray[np.float64]) -> NDArray[np.float64]:
    cells = closed.cells
    low = np.maximum(cells.min(axis=0) - _MARGIN, 0)
    high = cells.max(axis=0) + _MARGIN + 1
    window = state[low[0] : high[0], low[1] : high[1]]
    rows, cols = (cells - low).T
    wall = _steps_to(window == OCCUPIED)[rows, cols]
    water = _steps_to(window == FREE)[rows, cols]
    share = np.minimum(closed.away / max(closed.candidate.gap, 1.0), 1.0)
    rim = cKDTree(closed.candidate.path).query(cells)[0]
    agreed = np.mean(spread <= _SAME, axis=1)
    return np.stack(
        [
            wall <= 1.0,
            wall == 2.0,
            np.log(wall),
            np.log1p(closed.away),
            share,
            water <= 1.0,
            water == 2.0,
            np.log(water),
            _both_sides(closed, window == FREE, low),
            rim,
            np.log1p(spread.mean(axis=1)),
            agreed,
            _rivals_agree(closed),
        ],
        axis=1,
    ).astype(np.float64)


def _steps_to(mask: NDArray[np.bool_]) -> NDArray[np.float64]:
    """King's moves ``(rows, cols)`` to the nearest cell of the mask, at least 1 and no more than is worth telling."""
    if not mask.any():
        return np.full(mask.shape, _FAR)
    return np.asarray(np.clip(ndimage.distance_transform_cdt(~mask, "chessboard"), 1.0, _FAR), np.float64)


def _both_sides(closed: Closed, water: NDArray[np.bool_], low: NDArray[np.int64]) -> NDArray[np.float64]:
    """Whether water lies on both sides of the fill near a cell ``(n,)``: up to five cells off, square to the chord."""
    (ax, ay), (bx, by) = closed.candidate.start, closed.candidate.finish
    length = max(float(np.hypot(bx - ax, by - ay)), 1e-9)
    aside = np.array([(bx - ax), -(by - ay)]) / length  # row, col
    off = np.arange(1.0, 6.0)
    found = []
    for sign in (1.0, -1.0):
        looks = cell_at(closed.cells[:, None] + sign * off[:, None] * aside - low)
        inside = np.all((looks >= 0) & (looks < water.shape), axis=2)
        looks = np.where(inside[..., None], looks, 0)
        found.append(np.any(water[looks[..., 0], looks[..., 1]] & inside, axis=1))
    return np.asarray(found[0] & found[1], np.float64)


def _spread(closed: Closed) -> NDArray[np.float64]:
    """Distance ``(n, k)`` of each cell from each curve that its two ends allow, cells."""
    a, b = closed.candidate.ends
    found = [straight(a.x, a.y, b.x, b.y)]
    if not closed.candidate.side:
        found += curves(a, b, chord(a, b))
    places = closed.cells[:, ::-1].astype(np.float64)
    return np.stack([cKDTree(curve.points).query(places)[0] for curve in found], axis=1)


def _rivals_agree(closed: Closed) -> NDArray[np.float64]:
    """Share ``(n,)`` of the rivals' chances that belongs to those which pass a cell too; 1 where there is none."""
    total, shared = 0.0, np.zeros(len(closed.cells))
    for rival, chance in closed.rivals:
        total += chance
        shared += chance * _passed(rival.path, closed.cells)
    return shared / total if total > 0.0 else np.ones(len(closed.cells))


def _passed(path: NDArray[np.int32], cells: NDArray[np.int32]) -> NDArray[np.bool_]:
    """Whether each cell ``(n,)`` is one of a path or close to one; both are so short that a tree costs more."""
    rows, cols = path.T
    apart = (cells[:, :1] - rows) ** 2 + (cells[:, 1:] - cols) ** 2
    return np.asarray(apart.min(axis=1) <= _SAME**2, np.bool_)
