"""Ways to lead a wall across a hole: from one end to another, or from an end onto the side of a wall.

Every way that crosses no free water is drawn, and those that run alike are drawn once; which of them is right is for
the judgement of all (``matching``), not for the first that passes.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fill.channels import channels
from fill.curves import Chord, Curve, bowed, cells_of, chord, corner, polynomial, steps, straight, tangent
from fill.freedom import at, clear_path
from fill.scene import Scene
from fill.segments import End, cell_at
from mapping.values import FREE

_BOWS: Final = np.array([0.0, 1.0, -1.0, 2.0, -2.0, 3.0, -3.0])  # cells
_FLAT: Final = 1.0  # radians off the chord up to which a wall is a function of the way along it
_BENT: Final = math.radians(15.0)  # less is as good as straight
_THROUGH: Final = 2  # cells of another wall, beside specks, that a way may pass
_ALIKE: Final = 1.2  # cells between ways that are the same
_PLACES: Final = 12  # of a way that are compared
_GLANCES: Final = np.radians(np.arange(-60.0, 61.0, 7.5))
_SIDES: Final = 3  # places on the sides of walls that an end is led to
_APART: Final = 4.0  # cells between two such places
_OWN: Final = 2.5  # cells beside an end where its own wall is not met


@dataclass(frozen=True, slots=True, eq=False)
class Way:
    """A way from one end to another, or to the side of a wall; ``ends`` are the two as they were found.

    ``path`` ``(n, 2)`` int32 of row and column, joined edge to edge; ``bow`` the rank of the bow that let the curve
    pass, or of the place on the side of a wall.
    """

    ends: tuple[End, End]
    side: bool
    chord: Chord
    curve: Curve
    path: NDArray[np.int32]
    bow: int

    @property
    def joined(self) -> tuple[End, ...]:
        """The true ends that it joins."""
        return self.ends[:1] if self.side else self.ends


@dataclass(frozen=True, slots=True)
class Drawn:
    """Ways, and what was looked at for them.

    ``looked`` ``(n, 2)`` are places, x and y, about which cells within ``margin`` were looked at; ``led``: also those
    between the ends, as ``channels`` does.
    """

    ways: list[Way]
    looked: NDArray[np.float64]
    margin: float
    led: bool = False


def across(a: End, b: End, scene: Scene) -> Drawn:
    """Draw every way between two ends that crosses no free water."""
    between = chord(a, b)
    highest = 0.25 * between.gap + 1.0
    heights = _BOWS[np.abs(_BOWS) <= highest]
    drawn = curves_between(a, b, between)
    found: list[Way] = []
    for curve in drawn:
        way = _first_clear(curve, heights, (a, b), between, scene)
        if way is not None and _new(way, found):
            found.append(way)
    for curve, cells in channels(a, b, scene):
        path = _path(cells_of(curve.points), (a, b), scene)
        if path is None:
            path = _path(cells, (a, b), scene)
        if path is not None:
            way = Way((a, b), False, between, curve, path, 0)
            found += [way] if _new(way, found) else []
    return Drawn(found, np.concatenate([curve.points for curve in drawn]), min(highest, _BOWS.max()) + 2.0, True)


def onto_sides(a: End, scene: Scene, longest: float) -> Drawn:
    """Let a wall go on until it meets another, or itself, at a place that is no end."""
    found = []
    places, looked = _meets(a, scene, longest)
    for rank, (x, y) in enumerate(places):
        row, col = cell_at(np.array([y, x])).tolist()
        gap = math.hypot(x - a.x, y - a.y)
        into = (a.x - x) / gap, (a.y - y) / gap
        b = End(x, y, *into, a.half, a.line, a.length, a.wander, int(scene.walls.label[row, col]))
        curve = straight(a.x, a.y, x, y, "side")
        path = _path(cells_of(curve.points), (a, b), scene)
        if path is not None:
            found.append(Way((a, b), True, chord(a, b), curve, path, rank))
    return Drawn(found, looked, 2.0)


def curves_between(a: End, b: End, between: Chord) -> list[Curve]:
    """Curves from ``a`` to ``b``, the plainest first."""
    steepest = max(between.bend_a, between.bend_b)
    found = [straight(a.x, a.y, b.x, b.y)]
    if steepest < _FLAT:
        found.append(polynomial(a, b))
    if max(between.turn, steepest) > _BENT:
        found.append(tangent(a, b, between))
    return found + corner(a, b) + steps(a, b)


def _first_clear(
    curve: Curve, heights: NDArray[np.float64], ends: tuple[End, End], between: Chord, scene: Scene
) -> Way | None:
    """Return the least bow of a curve that passes."""
    points = bowed(curve, heights)
    crosses = np.any(at(scene.state, points[..., 0], points[..., 1]) == FREE, axis=1)
    for rank in np.flatnonzero(~crosses).tolist():
        bow = Curve(curve.name, points[rank])
        path = _path(cells_of(bow.points), ends, scene)
        if path is not None:
            return Way(ends, False, between, bow, path, rank)
    return None


def _path(cells: NDArray[np.int32], ends: tuple[End, End], scene: Scene) -> NDArray[np.int32] | None:
    path = clear_path(cells, scene.state)
    if path is None:
        return None
    met = scene.walls.label[path[:, 0], path[:, 1]]
    others = ~scene.speck[met] & (met != ends[0].wall) & (met != ends[1].wall)
    return None if np.count_nonzero(others) > _THROUGH else path


def _new(way: Way, found: list[Way]) -> bool:
    """Whether a way leaves each of those found before by more than a cell somewhere."""
    points = way.curve.points
    places = points[np.linspace(0, len(points) - 1, _PLACES).astype(np.int64)]
    for other in found:
        apart = places[:, None] - other.curve.points[None, ::2]
        if np.hypot(apart[..., 0], apart[..., 1]).min(axis=1).max() <= _ALIKE:
            return False
    return True


def _meets(a: End, scene: Scene, longest: float) -> tuple[list[tuple[float, float]], NDArray[np.float64]]:
    """Where walls are met first by looks ahead and aside with no free water before: x and y in cells, best first."""
    along = np.arange(1.0, longest, 0.5)
    turn = math.atan2(a.dy, a.dx) + _GLANCES[:, None]
    x, y = a.x + along * np.cos(turn), a.y + along * np.sin(turn)
    rows, cols = scene.state.shape
    row, col = cell_at(y), cell_at(x)
    inside = (row >= 0) & (row < rows) & (col >= 0) & (col < cols)
    row, col = np.clip(row, 0, rows - 1), np.clip(col, 0, cols - 1)
    label = scene.walls.label[row, col]
    wall = inside & ~scene.speck[label] & ~((label == a.wall) & (along < _OWN))
    first = np.argmax(~inside | (scene.state[row, col] == FREE) | wall, axis=1)
    looks = np.arange(len(_GLANCES))
    price = np.where(wall[looks, first], along[first] * (2.0 - np.cos(_GLANCES)) ** 2, np.inf)
    found: list[tuple[float, float]] = []
    for look in np.argsort(price, kind="stable").tolist():
        if not np.isfinite(price[look]) or len(found) == _SIDES:
            break
        place = float(x[look, first[look]]), float(y[look, first[look]])
        if all(math.hypot(place[0] - other[0], place[1] - other[1]) >= _APART for other in found):
            found.append(place)
    last = np.stack([x[looks, first], y[looks, first]])
    return found, np.stack([np.minimum(last.min(axis=1), (a.x, a.y)), np.maximum(last.max(axis=1), (a.x, a.y))])
