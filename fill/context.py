"""What tells whether a way closes a hole rightly: its shape, what was seen beside it, and how its walls end.

Nothing here knows left from right or the first end from the second, so that a mirrored map is judged the same.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fill.freedom import at, face
from fill.scene import FARTHEST, Scene
from fill.segments import End
from fill.ways import Way
from mapping.values import FREE, OCCUPIED, UNKNOWN

_BETWEEN: Final = ("water both", "log gap", "log water", "near reach", "near bulge", "snug both", "tips flanked")
FEATURES: Final = (
    "one", "log gap", "short", "bend", "lesser bend", "turn", "offset", "lesser offset", "half", "uneven",
    "kink", "lesser kink", "kink x log gap", "lesser kink x log gap", "corner x turn",
    "bent", "bent x turn",
    "log support", "log longer support", "wander", "detour", "bow", "tangent", "corner", "channel", "shore", "side",
    "near both", "near one", "water both", "snug both", "snug any", "near water", "far water", "near ragged",
    "far ragged", "near bulge", "far bulge", "near reach", "far reach", "wall beyond", "wall close",
    "divides", "water both, divides", "near both, divides",
    "tips flanked", "walls flanked", "tips half flanked", "walls half flanked", "faces", "freer face",
    "specks", "log water", "water ragged", "closer partners", "turn x log gap",
    "passage", *(f"passage: {name}" for name in _BETWEEN),
)  # fmt: skip
"""What a candidate is judged by, in this order."""

_PLACES: Final = 12  # along a way that are looked from
_MIDDLE: Final = slice(1, _PLACES - 1)
_BEHIND: Final = (2, 4, 7)  # cells behind an end: what its wall has at its sides
_OFF: Final = np.arange(1.0, FARTHEST + 1.0)
_SEEN: Final = slice(1, 7)  # cells off the face that are near
_DENSE: Final = 4  # cells of water in a row that are water and not a stray ray
_REACH: Final = 0.6  # of the gap: so far to its sides water is looked for
_CLOSE: Final = 5
_PASSABLE: Final = 4.0  # cells; narrower gaps are no passage
_WET: Final = 0.35
_BOWS: Final = 6
_LEAVING: Final = 16  # steps of a quarter cell over which a way leaves its wall
_BEYOND_SIGHT: Final = 28.0  # cells: length of a wall that is followed no further


@dataclass(frozen=True, slots=True)
class Beside:
    """What is seen from places along a way and its walls, square to it, over ``FARTHEST`` cells off the face.

    ``seen`` ``(2, n, cells)`` uint8; ``away`` ``(2, n)`` cells to the first that is not unknown; ``water`` and ``wall``
    ``(2, n)`` bool tell what that is.  The first ``_PLACES`` lie on the way, then three behind either end.
    """

    seen: NDArray[np.uint8]
    away: NDArray[np.int64]
    water: NDArray[np.bool_]
    wall: NDArray[np.bool_]


def features(way: Way, scene: Scene, closer: float) -> NDArray[np.float64]:
    """Features ``(k,)`` after ``FEATURES``; ``closer`` is how much nearer other partners of its ends are."""
    beside = _beside(way, scene.state)
    found = _shape(way) | _banks(way, beside) | _jambs(way, beside, scene.state) | _under(way, scene)
    found["one"] = 1.0
    found["closer partners"] = closer
    found["water both, divides"] = found["water both"] * found["divides"]
    found["near both, divides"] = found["near both"] * found["divides"]
    found["kink x log gap"] = found["kink"] * found["log gap"]
    found["lesser kink x log gap"] = found["lesser kink"] * found["log gap"]
    found["bent x turn"] = found["bent"] * found["turn"]
    found["corner x turn"] = found["corner"] * found["turn"]
    found["turn x log gap"] = found["turn"] * found["log gap"]
    passage = float(found["water both"] > _WET and way.chord.gap > _PASSABLE)
    found["passage"] = passage
    found |= {f"passage: {name}": passage * found[name] for name in _BETWEEN}
    return np.array([found[name] for name in FEATURES])


def _shape(way: Way) -> dict[str, float]:
    """How the ends lie to each other, and how the way runs between them."""
    (a, b), side = way.ends, way.second < 0
    gap = max(way.chord.gap, 1.0)
    doubt = math.atan(1.0 / gap)  # a cell of stairs turns a short chord by this much
    bends = sorted((way.chord.bend_a, way.chord.bend_a if side else way.chord.bend_b))
    less, bend = bends if side else [max(0.0, each - doubt) for each in bends]
    lengths = sorted((a.length, max(a.length, _BEYOND_SIGHT) if side else b.length))
    length = 0.25 * len(way.curve.points)
    lesser_kink, kink = _kinks(way)
    return {
        "log gap": math.log(gap),
        "short": 1.0 / gap,
        "bend": bend,
        "lesser bend": less,
        "turn": 0.0 if side else max(0.0, way.chord.turn - doubt),
        "offset": math.log1p(gap * math.sin(min(bend, math.pi / 2))),
        "lesser offset": math.log1p(gap * math.sin(min(less, math.pi / 2))),
        "kink": kink,
        "lesser kink": lesser_kink,
        "half": math.log1p((a.half + b.half) / 2.0),
        "uneven": 0.0 if side else abs(a.half - b.half),
        "log support": math.log(lengths[0]),
        "log longer support": math.log(lengths[1]),
        "wander": max(a.wander, 0.0 if side else b.wander),
        "detour": math.log(max(length, 1.0) / gap),
        "bent": float(way.curve.name in ("quadratic", "cubic")),
        "bow": min(way.bow, _BOWS) / 2.0,
    } | {name: float(way.curve.name == name) for name in ("tangent", "corner", "channel", "shore", "side")}


def _kinks(way: Way) -> list[float]:
    """Angles between the walls and the way where it leaves them, the lesser first; a cell of stairs is forgiven."""
    points = way.curve.points
    run = min(_LEAVING, len(points) - 1)
    (a, b), out, back = way.ends, points[run] - points[0], points[-1 - run] - points[-1]
    doubt = math.atan(1.0 / max(0.25 * run, 1.0))
    kinks = [_angle((a.dx, a.dy), out)] + ([_angle((b.dx, b.dy), back)] if way.second >= 0 else [])
    return sorted(max(0.0, kink - doubt) for kink in (kinks if len(kinks) > 1 else kinks * 2))


def _angle(aim: tuple[float, float], way: NDArray[np.float64]) -> float:
    """Angle between two directions, 0 to pi."""
    return abs(math.atan2(aim[0] * way[1] - aim[1] * way[0], aim[0] * way[0] + aim[1] * way[1]))


def _beside(way: Way, state: NDArray[np.uint8]) -> Beside:
    points = way.curve.points
    places = points[np.linspace(0, len(points) - 1, _PLACES).astype(np.int64)]
    ahead = np.gradient(places, axis=0)
    a, b = way.ends
    met = places[-1:].repeat(len(_BEHIND), axis=0), ahead[-1:].repeat(len(_BEHIND), axis=0)
    walls = _behind(a, 1.0), _behind(b, -1.0) if way.second >= 0 else met
    places = np.concatenate([places, walls[0][0], walls[1][0]])
    ahead = np.concatenate([ahead, walls[0][1], walls[1][1]])
    ahead /= np.maximum(np.hypot(ahead[:, 0], ahead[:, 1]), 1e-9)[:, None]
    off = _OFF + max((a.half + b.half) / 2.0 - 0.5, 0.0)
    lateral = np.array([1.0, -1.0])[:, None, None] * off
    seen = at(state, places[:, 0, None] - lateral * ahead[:, 1, None], places[:, 1, None] + lateral * ahead[:, 0, None])
    known = seen != UNKNOWN
    away = np.where(known.any(axis=2), known.argmax(axis=2), len(_OFF))
    nearest = np.minimum(away[:, :, None] + np.arange(_DENSE), len(_OFF) - 1)
    run = np.take_along_axis(seen, nearest, axis=2)
    water = (run[:, :, 0] == FREE) & (np.mean(run == FREE, axis=2) > 0.6)
    return Beside(seen, away, water, run[:, :, 0] == OCCUPIED)


def _behind(end: End, sign: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Places on the wall behind an end, and its direction there."""
    places = end.line[np.minimum(_BEHIND, len(end.line) - 1)]
    return places, np.repeat([[end.dx * sign, end.dy * sign]], len(_BEHIND), axis=0)


def _banks(way: Way, beside: Beside) -> dict[str, float]:
    """Tell what lies on either side of a way: water, how near, and whether its edge runs along the way or bulges."""
    gap = max(way.chord.gap, 1.0)
    reach = beside.away[:, _MIDDLE] <= _REACH * gap + 4.0
    water = beside.water[:, _MIDDLE] & reach
    off = np.log1p(np.where(beside.water, beside.away, int(FARTHEST)))[:, _MIDDLE]
    near, far = off[np.argsort(off.mean(axis=1), kind="stable")]
    share = np.mean(beside.seen[:, _MIDDLE, _SEEN] == FREE, axis=2)
    snug = np.mean(beside.seen[:, _MIDDLE, :2] == FREE, axis=2)
    wall = beside.wall[:, _MIDDLE]
    radius = math.log1p(gap / 2.0)
    return {
        "near both": float(share.min(axis=0).mean()),
        "near one": float(np.abs(share[0] - share[1]).mean()),
        "water both": float(np.mean(water[0] & water[1])),
        "snug both": float(snug.min(axis=0).mean()),
        "snug any": float(snug.max(axis=0).mean()),
        "near water": float(near.mean()),
        "far water": float(far.mean()),
        "near ragged": float(near.std()),
        "far ragged": float(far.std()),
        "near bulge": _bulge(near),
        "far bulge": _bulge(far),
        "near reach": float(near[3:7].mean()) - radius,
        "far reach": float(far[3:7].mean()) - radius,
        "wall beyond": float(np.any(wall & reach, axis=0).mean()),
        "wall close": float(np.any(wall & (beside.away[:, _MIDDLE] <= _CLOSE), axis=0).mean()),
    }


def _bulge(off: NDArray[np.float64]) -> float:
    """How much further water is from the middle of a way than from its ends."""
    return float(off[3:7].mean() - off[[0, 1, -2, -1]].mean())


def _jambs(way: Way, beside: Beside, state: NDArray[np.uint8]) -> dict[str, float]:
    """How the walls end: with water along their sides to the tip, with water before their face, or in the unknown."""
    behind = slice(_PLACES, None)
    flank = np.any(beside.seen[:, behind, :3] == FREE, axis=2)
    both, one = flank[0] & flank[1], flank[0] | flank[1]
    tips, deep = [0, len(_BEHIND)], [len(_BEHIND) - 1, 2 * len(_BEHIND) - 1]
    faces = [face(end, state) for end in (way.ends if way.second >= 0 else way.ends[:1])]
    return {
        "divides": float(np.mean(beside.seen[:, behind, _SEEN] == FREE, axis=2).min(axis=0).mean()),
        "tips flanked": float(both[tips].mean()),
        "walls flanked": float(both[deep].mean()),
        "tips half flanked": float(one[tips].mean()),
        "walls half flanked": float(one[deep].mean()),
        "faces": sum(faces) / len(faces),
        "freer face": max(faces),
    }


def _under(way: Way, scene: Scene) -> dict[str, float]:
    """Tell what the way itself passes."""
    rows, cols = way.path.T
    water = np.log(np.maximum(scene.water[rows, cols], 0.5))
    return {
        "specks": float(np.mean(scene.state[rows, cols] == OCCUPIED)),
        "log water": float(water.mean()),
        "water ragged": float(water.std()),
    }
