"""Curves that could carry a wall across a hole, and the cells that they cross.

The paper fits y = f(x) (section 3.1.1), which no vertical wall survives; here every polynomial lives in the frame of
the chord, u along it and v across, and besides polynomials there are tangent curves and corners.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fill.segments import End, cell_at

_STEP: Final = 0.25  # cells between two points of a curve
_NOISE: Final = 0.4  # standard deviation of a centre line about its wall, cells
_FLAT: Final = 1.0  # radians off the chord up to which a wall is a function of u
_CORNER_FROM: Final = math.radians(40.0)
_ALIGNED: Final = 1.7  # length of the sum of two directions that run alike
_LEAST_STEP: Final = 2.0  # cells


@dataclass(frozen=True, slots=True)
class Curve:
    """A curve from one end to the other: ``points`` ``(n, 2)`` float64 of x and y in cells, a quarter cell apart."""

    name: str
    points: NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Chord:
    """How two ends lie to each other.

    ``gap`` is between them, ``side_a`` and ``side_b`` are the walls' directions off the chord in radians, with sign.
    """

    gap: float
    side_a: float
    side_b: float

    @property
    def bend_a(self) -> float:
        """Angle between the first wall's direction and the chord."""
        return abs(self.side_a)

    @property
    def bend_b(self) -> float:
        """Angle between the second wall's direction and the chord."""
        return abs(self.side_b)

    @property
    def turn(self) -> float:
        """Angle by which the wall turns from one end to the other."""
        return abs(_wrapped(self.side_a + self.side_b))


def chord(a: End, b: End) -> Chord:
    """Measure how end ``b`` lies to end ``a``."""
    along = math.atan2(b.y - a.y, b.x - a.x)
    side_a = _wrapped(math.atan2(a.dy, a.dx) - along)
    side_b = _wrapped(along - math.atan2(-b.dy, -b.dx))
    return Chord(math.hypot(b.x - a.x, b.y - a.y), side_a, side_b)


def curves(a: End, b: End, between: Chord) -> list[Curve]:
    """Curves from ``a`` to ``b``, the likeliest first."""
    found = []
    if between.turn > _CORNER_FROM:
        found += corner(a, b)
    if max(between.bend_a, between.bend_b) < _FLAT:
        found.append(polynomial(a, b))
    found.append(tangent(a, b, between))
    if between.turn <= _CORNER_FROM:
        found += corner(a, b)
    return found


def straight(x0: float, y0: float, x1: float, y1: float, name: str = "line") -> Curve:
    """Return the straight curve between two places."""
    return Curve(name, sampled(np.array([[x0, y0], [x1, y1]])))


def bowed(curve: Curve, heights: NDArray[np.float64]) -> NDArray[np.float64]:
    """Points ``(h, n, 2)`` of a curve with its middle pushed sideways by each of ``heights`` ``(h,)`` cells."""
    ahead = curve.points[-1] - curve.points[0]
    share = np.linspace(0.0, 1.0, len(curve.points))
    normal = np.array([-ahead[1], ahead[0]]) / max(math.hypot(*ahead), 1e-9)
    return curve.points + (heights[:, None] * (4.0 * share * (1.0 - share)))[:, :, None] * normal


def cells_of(points: NDArray[np.float64]) -> NDArray[np.int32]:
    """Cells ``(n, 2)`` of row and column that a curve passes, each once in a row."""
    cells: NDArray[np.int32] = cell_at(points[:, ::-1]).astype(np.int32)
    moved = cells[1:] != cells[:-1]
    fresh = np.ones(len(cells), np.bool_)
    fresh[1:] = moved[:, 0] | moved[:, 1]
    return np.asarray(cells[fresh], np.int32)


def corner(a: End, b: End) -> list[Curve]:
    """Both walls go on straight until they meet, where they do so ahead of both."""
    cross = a.dx * b.dy - a.dy * b.dx
    if abs(cross) < math.sin(_CORNER_FROM / 2):
        return []
    apart_x, apart_y = b.x - a.x, b.y - a.y
    from_a = (apart_x * b.dy - apart_y * b.dx) / cross
    from_b = (apart_x * a.dy - apart_y * a.dx) / cross
    gap = math.hypot(apart_x, apart_y)
    if not (-1.5 <= from_a <= 1.5 * gap + 2 and -1.5 <= from_b <= 1.5 * gap + 2):
        return []
    meet = (a.x + a.dx * max(from_a, 0.0), a.y + a.dy * max(from_a, 0.0))
    return [Curve("corner", sampled(np.array([(a.x, a.y), meet, (b.x, b.y)])))]


def steps(a: End, b: End) -> list[Curve]:
    """Two walls that run alike but not in line: one goes on until it is level with the other, and jogs over to it."""
    along = np.array([a.dx - b.dx, a.dy - b.dy])
    size = math.hypot(*along)
    if size < _ALIGNED:
        return []
    along /= size
    start, finish = np.array([a.x, a.y]), np.array([b.x, b.y])
    ahead = float((finish - start) @ along)
    aside = float(np.hypot(*(finish - start - ahead * along)))
    if ahead < _LEAST_STEP or aside < _LEAST_STEP:
        return []
    places = (start + share * ahead * along for share in (1.0, 0.0, 0.5))
    turns = [(place, place + (finish - start) - ahead * along) for place in places]
    return [Curve("step", sampled(np.array([start, *turn, finish]))) for turn in turns]


def tangent(a: End, b: End, between: Chord) -> Curve:
    """Cubic Hermite curve that leaves both walls along their own directions."""
    reach = between.gap * min(1.0, 1.0 / max(0.5, math.cos(between.turn / 4.0) ** 2))
    share = np.linspace(0.0, 1.0, max(8, int(between.gap / _STEP)))[:, None]
    start, finish = np.array([a.x, a.y]), np.array([b.x, b.y])
    out, into = np.array([a.dx, a.dy]) * reach, -np.array([b.dx, b.dy]) * reach
    points = (
        (2 * share**3 - 3 * share**2 + 1) * start
        + (share**3 - 2 * share**2 + share) * out
        + (3 * share**2 - 2 * share**3) * finish
        + (share**3 - share**2) * into
    )
    return Curve("tangent", sampled(points))


def polynomial(a: End, b: End) -> Curve:
    """Polynomial through both walls in the frame of the chord; its order by Akaike's corrected criterion."""
    origin = np.array([a.x, a.y])
    ahead = np.array([b.x, b.y]) - origin
    gap = math.hypot(*ahead)
    along = ahead / gap if gap > 0 else np.array([a.dx, a.dy])
    frame = np.stack([along, [-along[1], along[0]]], axis=1)
    behind, beyond = (np.array(end.line[:12]) for end in (a, b))
    seen = (np.concatenate([behind, beyond, [origin, origin + ahead]]) - origin) @ frame
    middle, scale = gap / 2.0, gap / 2.0 + 12.0
    order, weights = _best_order((seen[:, 0] - middle) / scale, seen[:, 1])
    u = np.linspace(0.0, gap, max(2, int(gap / _STEP)))
    v = np.polynomial.polynomial.polyval((u - middle) / scale, weights)
    # The curve starts and ends where the walls do: what it misses there is taken out in proportion.
    v = v - v[0] * (1.0 - u / max(gap, 1e-9)) - v[-1] * (u / max(gap, 1e-9))
    points = origin + np.stack([u, v], axis=1) @ frame.T
    return Curve(("line", "quadratic", "cubic")[order - 1], sampled(points))


def _best_order(u: NDArray[np.float64], v: NDArray[np.float64]) -> tuple[int, NDArray[np.float64]]:
    basis = np.vander(u, 4, increasing=True)
    count = max(len(u) / 2.0, 6.0)  # neighbouring points of a centre line are not independent
    fits = []
    for order in (1, 2, 3):
        weights = np.asarray(np.linalg.lstsq(basis[:, : order + 1], v, rcond=None)[0], np.float64)
        error = float(np.mean((basis[:, : order + 1] @ weights - v) ** 2)) + _NOISE**2
        free = order + 2.0
        score = count * math.log(error) + 2 * free + 2 * free * (free + 1) / max(count - free - 1, 1.0)
        fits.append((score, order, weights))
    return min(fits, key=lambda fit: fit[0])[1:]


def sampled(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Resample a polyline at equal steps of a quarter cell."""
    steps = points[1:] - points[:-1]
    length = np.zeros(len(points))
    np.cumsum(np.hypot(steps[:, 0], steps[:, 1]), out=length[1:])
    at = np.linspace(0.0, length[-1], max(2, math.ceil(length[-1] / _STEP) + 1))
    places = np.empty((len(at), 2))
    for axis in (0, 1):
        places[:, axis] = np.interp(at, length, points[:, axis])
    return places


def _wrapped(angle: float) -> float:
    return (angle + math.pi) % (2.0 * math.pi) - math.pi
