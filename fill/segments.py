"""Walls as centre lines, and the true ends of these.

An end is where a wall stops being seen.  Rings (pillars, finished rooms) have none, every branch keeps its own, a
thick wall ends in its middle, and blobs that are no longer than they are thick are not walls.  The paper finds ends
by two passes of Dijkstra's algorithm (section 3.2), which invents two ends on every ring and loses those of branches;
skeletons do neither.

Coordinates here are cells: x is the column, y the row, whole numbers at cell centres.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from skimage.morphology import skeletonize

from fill.centre import CentreLines

EIGHT: Final = np.ones((3, 3), np.int8)
SUPPORT: Final = 14
"""How many cells of centre line behind an end tell its direction."""
_WEIGHTS: Final = np.linspace(1.0, 0.4, SUPPORT + 1)  # the nearest part of a wall tells most about its direction
_BENDABLE: Final = 16  # cells of centre line from which a bend can be told
_CLEARLY: Final = 0.5
_EVEN: Final = 0.5  # cells off the parabola: more is a corner
_OFF_TIP: Final = 1.0  # cells: an axis that misses the tip by more does not tell where the wall ends
_CORNER: Final = math.radians(45.0)
_LIMB: Final = (2, 9)  # cells of wall between a tip and the corner before it
_STRAIGHT: Final = 0.75  # cells off its chord at most
_TO_NEXT: Final = 0.5 + 1e-6  # of a cell
_DOT: Final = 3  # cells: less has no length
_MOST_TIPS_OF_ONE: Final = 1000
MOST_TIPS: Final = 6000
"""Of the largest walls; in the largest real maps there are 2,200."""
_SOLID: Final = 8.0  # cells from the nearest water: deeper is not wall but the ground behind it


@dataclass(frozen=True, slots=True, eq=False)
class End:
    """A true end of a wall; two are the same only if they are one object.

    ``x``, ``y`` is the middle of the end face, ``dx``, ``dy`` the unit direction out of the wall; ``half`` half the
    wall's thickness; ``line`` ``(n, 2)`` float64 the centre line behind the end, nearest first; ``length`` the centre
    line's length as far as it was followed; ``wander`` its mean distance from a straight line; ``wall`` the label of
    the connected wall.  All in cells.
    """

    x: float
    y: float
    dx: float
    dy: float
    half: float
    line: NDArray[np.float64]
    length: float
    wander: float
    wall: int


@dataclass(frozen=True, slots=True)
class Walls:
    """Walls of one grid, in layers ``(rows, cols)``, and their ends.

    ``mask`` of wall cells, ``label`` of connected walls (0: none), ``half`` distance of each wall cell from the
    wall's edge, ``centre`` mask of the centre lines.  ``tips`` ``(n, 2)`` int64 are row and column of the tips of lines
    before spurs are pruned, and ``noise`` ``(n,)`` tells which were not looked at for ends, since no wall has so many.
    """

    mask: NDArray[np.bool_]
    label: NDArray[np.int32]
    half: NDArray[np.float32]
    centre: NDArray[np.bool_]
    ends: tuple[End, ...]
    tips: NDArray[np.int64]
    noise: NDArray[np.bool_]


def find_walls(mask: NDArray[np.bool_], corner: tuple[int, int] = (0, 0), ended: bool = True) -> Walls:
    """Find the walls in ``mask`` ``(rows, cols)`` and their true ends, in order of row and column.

    ``corner`` is the mask's first cell: an end is the same to the byte from whichever part of a grid it was found in.
    Ends are looked for where ``ended``; without, centre lines are found in less time.
    """
    half = _depths(mask)
    wall = half > 0
    label = np.zeros(wall.shape, np.int32)
    ndimage.label(wall, EIGHT, output=label)
    lines = CentreLines(np.asarray(skeletonize(wall), np.bool_))  # type: ignore[no-untyped-call]
    tips = np.array(lines.tips(wall), np.int64)
    tips = tips[~_dots(label)[label.flat[tips]]]
    noise = _noise(tips, label)
    promising = ~(_dots(label) | noise)[label]
    lines.prune(half, promising)
    inner = slice(1, -1), slice(1, -1)
    found = (_end(at, lines, half, label, corner) for at in (lines.tips(promising) if ended else ()))
    kept = tuple(end for end in found if end is not None)
    return Walls(
        wall[inner],
        label[inner],
        half[inner],
        lines.mask()[inner],
        kept,
        lines.places(tips)[:, ::-1],
        noise[label.flat[tips]],
    )


def _dots(label: NDArray[np.int32]) -> NDArray[np.bool_]:
    """Tell for each label whether its wall is a dot, which has no ends."""
    return np.bincount(label.ravel()) < _DOT


def _noise(tips: NDArray[np.int64], label: NDArray[np.int32]) -> NDArray[np.bool_]:
    """Tell for each label whether it is all tips, and no wall; ``tips`` ``(n,)`` are cells numbered row by row."""
    size = np.bincount(label.ravel())
    count = np.bincount(label.ravel()[tips], minlength=len(size))
    noise = count > _MOST_TIPS_OF_ONE
    largest = np.argsort(np.where(noise, 0, -size), kind="stable")
    taken = np.cumsum(np.where(noise, 0, count)[largest])
    noise[largest[taken > MOST_TIPS]] = True
    return noise


def _depths(mask: NDArray[np.bool_]) -> NDArray[np.float32]:
    """Distance of each wall cell from the wall's edge, 0 elsewhere and deep inside solid ground; one cell wider."""
    depth: NDArray[np.float32] = ndimage.distance_transform_edt(np.pad(mask, 1)).astype(np.float32)
    if depth.max(initial=0.0) <= _SOLID:
        return depth
    # Ground that reaches the edge of the grid goes on beyond it.
    beyond = ndimage.distance_transform_edt(np.pad(np.pad(mask, int(_SOLID) + 1, mode="edge"), 1)).astype(np.float32)
    inner = slice(int(_SOLID) + 2, -int(_SOLID) - 2)
    return np.pad(np.where(beyond > _SOLID, 0, beyond)[inner, inner], 1)


def _end(
    at: int, lines: CentreLines, half: NDArray[np.float32], label: NDArray[np.int32], corner: tuple[int, int]
) -> End | None:
    path, _ = lines.follow(at, 2 * SUPPORT)
    thick = float(np.sort(half.ravel()[path])[len(path) // 2]) - 0.5
    if len(path) < 3 or len(path) + thick < 2.5 * thick + 2.0:
        return None
    places = lines.places(path)
    line = smooth(places - places[0])  # from the tip, so that nothing hangs on where the grid begins
    foot, out, wander = direction(line[: _limb(line)])
    if math.hypot(*(foot - line[0])) > _OFF_TIP:
        foot = line[0]
    reach = _to_edge(foot, out, half, places[0] + 1)
    steps = line[1:] - line[:-1]
    length = float(np.hypot(steps[:, 0], steps[:, 1]).sum()) + reach
    first = places[0] + corner[::-1]
    x, y = (foot + out * reach + first).tolist()
    return End(x, y, float(out[0]), float(out[1]), thick, line + first, length, wander, int(label.flat[at]))


def cell_at(place: NDArray[np.float64]) -> NDArray[np.int64]:
    """Row or column of the cell at a place; a place on the border of two is in the later one, wherever a grid begins.

    (Rounding to even gives it now to one, now to the other, and so does what is left of rounding errors.)
    """
    return np.asarray(np.floor(place + _TO_NEXT), np.int64)


def smooth(line: NDArray[np.int64]) -> NDArray[np.float64]:
    """Take the stairs out of a line of cells ``(n, 2)``: a running mean over three, ends kept."""
    if len(line) < 3:
        return line.astype(np.float64)
    inner = (line[:-2] + line[1:-1] + line[2:]) / 3.0
    return np.concatenate([line[:1], inner, line[-1:]])


def direction(line: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64], float]:
    """Foot on the wall's axis next to the tip, unit direction out of the wall there, mean distance from straight.

    ``line`` ``(n, 2)`` begins at the tip.  A wall that bends evenly has left its mean direction by the time it ends:
    where one bend explains the line clearly better than none, foot and direction are those of the bend.
    """
    near = line[: len(_WEIGHTS)]
    weight = _WEIGHTS[: len(near)]
    middle = weight @ near / weight.sum()
    off = line - middle
    xx, xy, yy = (weight @ (off[: len(near), a] * off[: len(near), b]) for a, b in ((0, 0), (0, 1), (1, 1)))
    turn = 0.5 * math.atan2(2.0 * xy, xx - yy)  # the major axis of the weighted points
    out = np.array([math.cos(turn), math.sin(turn)])
    if np.dot(near[0] - near[-1], out) < 0:
        out = -out
    normal = np.array([-out[1], out[0]])
    along, aside = off @ out, off @ normal
    bend = _bend(along, aside)
    if bend is None:
        return middle + out * along[0], out, float(np.abs(aside[: len(near)]).mean())
    slope = bend[1] + 2.0 * bend[2] * along[0]
    foot = middle + out * along[0] + normal * (bend[0] + bend[1] * along[0] + bend[2] * along[0] ** 2)
    left = np.abs(bend[0] + bend[1] * along + bend[2] * along**2 - aside)
    return foot, (out + normal * slope) / math.hypot(1.0, slope), float(left.mean())


def _limb(line: NDArray[np.float64]) -> int:
    """Return how many places of a line, from its tip, lie before a corner close behind the tip; all if there is none.

    A wall cut off just after a corner goes on as the short limb does, not as the long one.
    """
    best, found = _CORNER, len(line)
    for last in range(_LIMB[0], min(_LIMB[1], len(line) - 4)):
        if _turns_less(line, last, best):
            continue
        out, before = line[0] - line[last], line[last] - line[min(last + _LIMB[1], len(line) - 1)]
        size = math.hypot(*out)
        aside = np.abs((line[: last + 1] - line[last]) @ (-out[1], out[0])) / size
        angle = math.acos(max(-1.0, min(1.0, float(out @ before) / (size * math.hypot(*before)))))
        if angle > best and aside.max() < _STRAIGHT:
            best, found = angle, last + 1
    return found


def _turns_less(line: NDArray[np.float64], last: int, angle: float) -> bool:
    """Whether a line surely turns by less than an angle at a place; plain numbers tell it in a tenth of the time."""
    places: list[list[float]] = line[[0, last, min(last + _LIMB[1], len(line) - 1)]].tolist()
    (x0, y0), (x1, y1), (x2, y2) = places
    ahead_x, ahead_y, back_x, back_y = x0 - x1, y0 - y1, x1 - x2, y1 - y2
    size = math.hypot(ahead_x, ahead_y) * math.hypot(back_x, back_y)
    return ahead_x * back_x + ahead_y * back_y > (math.cos(angle) + 1e-9) * size


def _bend(along: NDArray[np.float64], aside: NDArray[np.float64]) -> NDArray[np.float64] | None:
    """Parabola through a line, where it is long enough, fits well, and clearly better than a straight line."""
    if len(along) < _BENDABLE:
        return None
    basis = np.stack([np.ones_like(along), along, along**2], axis=1)
    straight, bend = (
        np.linalg.solve(part.T @ part + 1e-9 * np.eye(part.shape[1]), part.T @ aside) for part in (basis[:, :2], basis)
    )
    before = float(np.abs(basis[:, :2] @ straight - aside).mean())
    after = float(np.abs(basis @ bend - aside).mean())
    return np.asarray(bend, np.float64) if after < min(_CLEARLY * before, _EVEN) else None


def _to_edge(
    foot: NDArray[np.float64], out: NDArray[np.float64], half: NDArray[np.float32], origin: NDArray[np.int64]
) -> float:
    """How far the wall still goes on from the foot of its axis, which is told from ``origin``, a cell (x, y)."""
    steps = 0
    while steps < 2 * _SOLID:
        x, y = foot + out * (0.5 * steps + 0.25)  # never on the border of two cells of a straight wall
        row, col = round(y) + origin[1], round(x) + origin[0]
        if not (0 <= row < half.shape[0] and 0 <= col < half.shape[1]) or half[row, col] <= 0:
            break
        steps += 1
    return max(0.5 * steps - 0.25, 0.0)  # the last place inside: one beyond may lie in water, which no way crosses
