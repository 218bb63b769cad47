"""Ways and candidates from memory: what each was made from, told as a key and a box of cells."""

from __future__ import annotations

import dataclasses
from collections.abc import Hashable, Sequence
from functools import partial
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fill.candidates import Candidate, judged
from fill.memory import Box, Memory, content
from fill.scene import FARTHEST, Scene
from fill.ways import Way, across, curves_between, onto_sides

_LED: Final = frozenset({"shore", "channel"})  # ways that were led by how far water is
_ASIDE: Final = 0.4  # of the gap: further off its ends no way is looked for ...
_BEYOND: Final = 6  # ... than this many cells more
_FACE: Final = 4  # cells about the sides of a way, and one to round


def ways_across(first: int, second: int, scene: Scene, memory: Memory) -> list[Way]:
    """Every way between two ends, as ``across`` finds them."""
    a, b = scene.ends[first], scene.ends[second]
    found = memory.recall(("across", *content(a), *content(b)), partial(_across, first, second, scene))
    return [_numbered(way, first, second) for way in found]


def ways_onto_sides(index: int, scene: Scene, longest: float, memory: Memory) -> list[Way]:
    """Every way from an end onto a wall, as ``onto_sides`` finds them."""
    key = ("side", longest, *content(scene.ends[index]))
    return [_numbered(way, index, -1) for way in memory.recall(key, partial(_onto_sides, index, scene, longest))]


def recalled(ways: Sequence[Way], closer: Sequence[float], scene: Scene, memory: Memory) -> list[Candidate]:
    """Make ways candidates."""

    def made(places: list[int]) -> list[tuple[Box, Candidate]]:
        chosen = [ways[place] for place in places]
        found = judged(chosen, scene, [closer[place] for place in places])
        return [(_judged_from(way), each) for way, each in zip(chosen, found, strict=True)]

    found = memory.recall_all([_key(way, each) for way, each in zip(ways, closer, strict=True)], made)
    return [
        each
        if (each.first, each.second) == (way.first, way.second)
        else dataclasses.replace(each, first=way.first, second=way.second)
        for way, each in zip(ways, found, strict=True)
    ]


def _key(way: Way, closer: float) -> Hashable:
    a, b = way.ends
    shape = way.curve.name, way.curve.points.tobytes(), way.path.tobytes(), way.bow
    return "candidate", *content(a), *content(b), way.second < 0, *shape, closer


def _judged_from(way: Way) -> Box:
    places = np.concatenate([way.curve.points, *(end.line[:8] for end in way.ends)])
    return _box(places, FARTHEST + max(end.half for end in way.ends) + _FACE)


def _across(first: int, second: int, scene: Scene) -> tuple[Box, list[Way]]:
    a, b = scene.ends[first], scene.ends[second]
    found = across(first, second, scene)
    drawn = curves_between(a, b, found[0].chord) if found and found[0].curve.name not in _LED else None
    if drawn is not None:
        margin = 0.25 * found[0].chord.gap + 3.0
        return _box(np.concatenate([curve.points for curve in drawn]), margin), found
    from_water = FARTHEST + _ASIDE * float(np.hypot(b.x - a.x, b.y - a.y)) + _BEYOND
    return _box(np.array([(a.x, a.y), (b.x, b.y)]), 1.6 * from_water), found


def _onto_sides(index: int, scene: Scene, longest: float) -> tuple[Box, list[Way]]:
    found, looked = onto_sides(index, scene, longest)
    return _box(looked, 2.0), found


def _box(places: NDArray[np.float64], margin: float) -> Box:
    """Box about places ``(n, 2)`` of x and y."""
    low, high = np.floor(places.min(axis=0) - margin), np.ceil(places.max(axis=0) + margin)
    return int(low[1]), int(low[0]), int(high[1]) + 1, int(high[0]) + 1


def _numbered(way: Way, first: int, second: int) -> Way:
    return way if (way.first, way.second) == (first, second) else dataclasses.replace(way, first=first, second=second)
