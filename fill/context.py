"""What tells whether a way closes a hole rightly: its shape, what was seen beside it, and how its walls end.

Nothing here knows left from right or the first end from the second, so that a mirrored map is judged the same.  Ways
are judged many at a time, and what is told of one does not hang on which others are among them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fill.beside import NEAREST, PLACES, Beside, look_beside
from fill.freedom import faces
from fill.scene import FARTHEST, Scene
from fill.ways import Way
from mapping.values import FREE, OCCUPIED

_BETWEEN: Final = ("water both", "log gap", "log water", "near reach", "near bulge", "snug both", "tips flanked")
FEATURES: Final = (
    "one", "log gap", "short", "bend", "lesser bend", "turn", "offset", "lesser offset", "half", "uneven",
    "kink", "lesser kink", "kink x log gap", "lesser kink x log gap", "corner x turn",
    "bent", "bent x turn",
    "log support", "log longer support", "wander", "detour", "bow", "tangent", "corner", "channel", "shore", "side",
    "step", "same wall", "hugs", "squeezed", "hugs x log gap", "squeezed x log gap",
    "near both", "near one", "water both", "snug both", "snug any", "near water", "far water", "near ragged",
    "far ragged", "near bulge", "far bulge", "near reach", "far reach", "wall beyond", "wall close",
    "divides", "water both, divides", "near both, divides",
    "tips flanked", "walls flanked", "tips half flanked", "walls half flanked", "faces", "freer face",
    "specks", "log water", "water ragged", "closer partners", "turn x log gap",
    "passage", *(f"passage: {name}" for name in _BETWEEN),
)  # fmt: skip
"""What a candidate is judged by, in this order."""

_KINDS: Final = ("tangent", "corner", "channel", "shore", "side", "step")
_MIDDLE: Final = slice(1, PLACES - 1)
_SEEN: Final = slice(1, 7)  # cells off the face that are near
_REACH: Final = 0.6  # of the gap: so far to its sides water is looked for
_CLOSE: Final = 5
_PASSABLE: Final = 4.0  # cells; narrower gaps are no passage
_WET: Final = 0.35
_BOWS: Final = 6
_HUGS: Final = 0.8  # cells off the place that a wall has whose water was seen
_SQUEEZED: Final = 0.4  # cells of water beyond its own thickness that a way has no room for
_LEAVING: Final = 16  # steps of a quarter cell over which a way leaves its wall
_BEYOND_SIGHT: Final = 28.0  # cells: length of a wall that is followed no further
_MOST: Final = 256  # ways judged at a time

Layer = NDArray[np.float64]
Told = dict[str, Layer]


@dataclass(frozen=True, slots=True)
class _Ways:
    """Ways as columns ``(n,)``: ``a``, ``b`` for either end, ``side`` where the second is the side of a wall.

    The curve of each runs along ``points`` ``(m, 2)`` from ``first`` to ``last``.
    """

    side: NDArray[np.bool_]
    points: Layer
    first: NDArray[np.int64]
    last: NDArray[np.int64]
    gap: Layer
    bend_a: Layer
    bend_b: Layer
    turn: Layer
    half_a: Layer
    half_b: Layer
    length_a: Layer
    length_b: Layer
    wander_a: Layer
    wander_b: Layer
    bow: Layer


def features(ways: Sequence[Way], scene: Scene, closer: Sequence[float]) -> Layer:
    """Features ``(n, k)`` after ``FEATURES``; ``closer`` is how much nearer other partners of a way's ends are."""
    parts = [slice(start, start + _MOST) for start in range(0, len(ways), _MOST)]
    told = [_features(ways[part], scene, np.array(closer[part])) for part in parts]
    return np.concatenate([np.zeros((0, len(FEATURES))), *told])


def _features(ways: Sequence[Way], scene: Scene, closer: Layer) -> Layer:
    columns = _columns(ways)
    beside = look_beside(ways, columns.points, columns.first, columns.last, scene.state)
    found = _shape(ways, columns) | _banks(columns.gap, beside)
    found |= _jambs(ways, columns.side, beside, scene.state) | _under(ways, columns, scene)
    found["one"] = np.ones(len(ways))
    found["closer partners"] = closer
    found["water both, divides"] = found["water both"] * found["divides"]
    found["near both, divides"] = found["near both"] * found["divides"]
    found["kink x log gap"] = found["kink"] * found["log gap"]
    found["lesser kink x log gap"] = found["lesser kink"] * found["log gap"]
    found["bent x turn"] = found["bent"] * found["turn"]
    found["corner x turn"] = found["corner"] * found["turn"]
    found["hugs x log gap"] = found["hugs"] * found["log gap"]
    found["squeezed x log gap"] = found["squeezed"] * found["log gap"]
    found["turn x log gap"] = found["turn"] * found["log gap"]
    passage = ((found["water both"] > _WET) & (columns.gap > _PASSABLE)).astype(np.float64)
    found["passage"] = passage
    found |= {f"passage: {name}": passage * found[name] for name in _BETWEEN}
    return np.stack([found[name] for name in FEATURES], axis=1)


def _columns(ways: Sequence[Way]) -> _Ways:
    rows = []
    for way in ways:
        (a, b), to = way.ends, way.chord
        rows.append(
            (to.gap, to.bend_a, to.bend_b, to.turn, a.half, b.half, a.length, b.length, a.wander, b.wander, way.bow)
        )
    points = np.concatenate([way.curve.points for way in ways])
    behind = np.cumsum([len(way.curve.points) for way in ways])
    first = np.concatenate([[0], behind[:-1]])
    side = np.array([way.side for way in ways])
    return _Ways(side, points, first, behind - 1, *np.array(rows, np.float64).T.copy())


def _shape(ways: Sequence[Way], of: _Ways) -> Told:
    """How the ends lie to each other, and how the way runs between them."""
    gap = np.maximum(of.gap, 1.0)
    doubt = np.where(of.side, 0.0, np.arctan(1.0 / gap))  # a cell of stairs turns a short chord by this much
    less, bend = _ranked(of.bend_a, np.where(of.side, of.bend_a, of.bend_b))
    less, bend = np.maximum(less - doubt, 0.0), np.maximum(bend - doubt, 0.0)
    lengths = _ranked(of.length_a, np.where(of.side, np.maximum(of.length_a, _BEYOND_SIGHT), of.length_b))
    length = 0.25 * (of.last - of.first + 1)
    lesser_kink, kink = _kinks(ways, of)
    kinds = np.array([way.curve.name for way in ways])
    return {
        "log gap": np.log(gap),
        "short": 1.0 / gap,
        "bend": bend,
        "lesser bend": less,
        "turn": np.where(of.side, 0.0, np.maximum(of.turn - doubt, 0.0)),
        "offset": np.log1p(gap * np.sin(np.minimum(bend, np.pi / 2))),
        "lesser offset": np.log1p(gap * np.sin(np.minimum(less, np.pi / 2))),
        "kink": kink,
        "lesser kink": lesser_kink,
        "half": np.log1p((of.half_a + of.half_b) / 2.0),
        "uneven": np.where(of.side, 0.0, np.abs(of.half_a - of.half_b)),
        "log support": np.log(lengths[0]),
        "log longer support": np.log(lengths[1]),
        "wander": np.maximum(of.wander_a, np.where(of.side, 0.0, of.wander_b)),
        "detour": np.log(np.maximum(length, 1.0) / gap),
        "bent": ((kinds == "quadratic") | (kinds == "cubic")).astype(np.float64),
        "bow": np.minimum(of.bow, _BOWS) / 2.0,
        "same wall": np.array([way.ends[0].wall == way.ends[1].wall for way in ways], np.float64),
    } | {name: (kinds == name).astype(np.float64) for name in _KINDS}


def _kinks(ways: Sequence[Way], of: _Ways) -> tuple[Layer, Layer]:
    """Angles between the walls and the way where it leaves them, the lesser first; a cell of stairs is forgiven."""
    run = np.minimum(_LEAVING, of.last - of.first)
    out = of.points[of.first + run] - of.points[of.first]
    back = of.points[of.last - run] - of.points[of.last]
    doubt = np.arctan(1.0 / np.maximum(0.25 * run, 1.0))
    aims = np.array([[(end.dx, end.dy) for end in way.ends] for way in ways])
    one, other = _angle(aims[:, 0], out), _angle(aims[:, 1], back)
    less, more = _ranked(one, np.where(of.side, one, other))
    return np.maximum(less - doubt, 0.0), np.maximum(more - doubt, 0.0)


def _ranked(one: Layer, other: Layer) -> tuple[Layer, Layer]:
    return np.minimum(one, other), np.maximum(one, other)


def _angle(aim: Layer, way: Layer) -> Layer:
    """Angles ``(n,)`` between directions ``(n, 2)``, 0 to pi."""
    across = aim[:, 0] * way[:, 1] - aim[:, 1] * way[:, 0]
    return np.abs(np.arctan2(across, aim[:, 0] * way[:, 0] + aim[:, 1] * way[:, 1]))


def _banks(gap: Layer, beside: Beside) -> Told:
    """Tell what lies on either side of a way: water, how near, and whether its edge runs along the way or bulges."""
    gap = np.maximum(gap, 1.0)
    away, wall = beside.away[:, :, _MIDDLE], beside.wall[:, :, _MIDDLE]
    reach = away <= (_REACH * gap + 4.0)[:, None, None]
    water = beside.water[:, :, _MIDDLE] & reach
    off = np.log1p(np.where(beside.water, beside.away, int(FARTHEST)))[:, :, _MIDDLE]
    mean = off.mean(axis=2)
    swapped = (mean[:, 1] < mean[:, 0])[:, None]
    near, far = np.where(swapped, off[:, 1], off[:, 0]), np.where(swapped, off[:, 0], off[:, 1])
    share = np.mean(beside.seen[:, :, _MIDDLE, _SEEN] == FREE, axis=3)
    snug = np.mean(beside.seen[:, :, _MIDDLE, :2] == FREE, axis=3)
    radius = np.log1p(gap / 2.0)
    return {
        "near both": share.min(axis=1).mean(axis=1),
        "near one": np.abs(share[:, 0] - share[:, 1]).mean(axis=1),
        "water both": np.mean(water[:, 0] & water[:, 1], axis=1),
        "snug both": snug.min(axis=1).mean(axis=1),
        "snug any": snug.max(axis=1).mean(axis=1),
        "near water": near.mean(axis=1),
        "far water": far.mean(axis=1),
        "near ragged": near.std(axis=1),
        "far ragged": far.std(axis=1),
        "near bulge": _bulge(near),
        "far bulge": _bulge(far),
        "near reach": near[:, 3:7].mean(axis=1) - radius,
        "far reach": far[:, 3:7].mean(axis=1) - radius,
        "wall beyond": np.any(wall & reach, axis=1).mean(axis=1),
        "wall close": np.any(wall & (away <= _CLOSE), axis=1).mean(axis=1),
    }


def _bulge(off: Layer) -> Layer:
    """How much further water is from the middle of a way than from its ends."""
    return np.asarray(off[:, 3:7].mean(axis=1) - off[:, [0, 1, -2, -1]].mean(axis=1), np.float64)


def _jambs(ways: Sequence[Way], side: NDArray[np.bool_], beside: Beside, state: NDArray[np.uint8]) -> Told:
    """How the walls end: with water along their sides to the tip, with water before their face, or in the unknown."""
    behind = beside.seen[:, :, PLACES:]
    flank = np.any(behind[..., :3] == FREE, axis=3)
    both, one = flank[:, 0] & flank[:, 1], flank[:, 0] | flank[:, 1]
    tips, deep = [0, NEAREST], [NEAREST - 1, 2 * NEAREST - 1]
    freer = faces([end for way in ways for end in way.ends], state).reshape(-1, 2)
    other = np.where(side, freer[:, 0], freer[:, 1])
    return {
        "divides": np.mean(behind[..., _SEEN] == FREE, axis=3).min(axis=1).mean(axis=1),
        "tips flanked": both[:, tips].mean(axis=1),
        "walls flanked": both[:, deep].mean(axis=1),
        "tips half flanked": one[:, tips].mean(axis=1),
        "walls half flanked": one[:, deep].mean(axis=1),
        "faces": (freer[:, 0] + other) / 2.0,
        "freer face": np.maximum(freer[:, 0], other),
    }


def _under(ways: Sequence[Way], of: _Ways, scene: Scene) -> Told:
    """Tell what the ways themselves pass."""
    rows, cols = np.concatenate([way.path for way in ways]).T
    count = np.array([len(way.path) for way in ways])
    first = np.cumsum(count) - count
    room = scene.water[rows, cols] - np.repeat((of.half_a + of.half_b) / 2.0, count)
    water = np.log(np.maximum(scene.water[rows, cols], 0.5))
    mean = np.add.reduceat(water, first) / count
    off = water - np.repeat(mean, count)
    return {
        "hugs": np.add.reduceat((np.abs(room - 1.0) <= _HUGS).astype(np.float64), first) / count,
        "squeezed": np.add.reduceat((room < _SQUEEZED).astype(np.float64), first) / count,
        "specks": np.add.reduceat((scene.state[rows, cols] == OCCUPIED).astype(np.float64), first) / count,
        "log water": mean,
        "water ragged": np.sqrt(np.add.reduceat(off * off, first) / count),
    }
