"""Ways and candidates from memory: what each was made from."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fill.candidates import Candidate, judged
from fill.channels import window
from fill.memory import Basis, Box, Memory
from fill.scene import FARTHEST, Scene
from fill.segments import End
from fill.ways import Drawn, Way, across, onto_sides
from mapping.trees import Trees

_NOTHING: Final = Basis((0, 0, 0, 0), walls=False)  # but the key
_FACE: Final = 4  # cells about the sides of a way, and one to round


def ways_across(a: End, b: End, scene: Scene, memory: Memory) -> list[Way]:
    """Every way between two ends, as ``across`` finds them."""
    return memory.recall(("across", a, b), partial(_across, a, b, scene))


def ways_onto_sides(end: End, scene: Scene, longest: float, memory: Memory) -> list[Way]:
    """Every way from an end onto a wall, as ``onto_sides`` finds them."""
    return memory.recall(("side", longest, end), partial(_onto_sides, end, scene, longest))


def recalled(ways: Sequence[Way], closer: Sequence[float], scene: Scene, memory: Memory) -> list[Candidate]:
    """Make ways candidates."""

    def made(places: list[int]) -> list[tuple[Basis, Candidate]]:
        chosen = [ways[place] for place in places]
        found = judged(chosen, scene, [closer[place] for place in places])
        return [(_judged_from(way), each) for way, each in zip(chosen, found, strict=True)]

    return memory.recall_all(list(zip(ways, closer, strict=True)), made)


def chances_of(found: Sequence[Candidate], model: Trees, memory: Memory) -> NDArray[np.float64]:
    """Chances ``(n,)`` of candidates, by the one model that this memory knows."""

    def made(places: list[int]) -> list[tuple[Basis, float]]:
        told = model.chance(np.stack([found[place].features for place in places]))
        return [(_NOTHING, chance) for chance in told.tolist()]

    return np.array(memory.recall_all([("chance", each) for each in found], made), np.float64)


def _across(a: End, b: End, scene: Scene) -> tuple[Basis, list[Way]]:
    drawn = across(a, b, scene)
    if not drawn.led:
        return Basis(_about(drawn)), drawn.ways
    low, high = window(a, b, math.hypot(b.x - a.x, b.y - a.y), scene.state.shape)
    wet = int(low[0]), int(low[1]), int(high[0]), int(high[1])
    return Basis(_both(_about(drawn), wet), wet), drawn.ways


def _onto_sides(end: End, scene: Scene, longest: float) -> tuple[Basis, list[Way]]:
    drawn = onto_sides(end, scene, longest)
    return Basis(_about(drawn)), drawn.ways


def _judged_from(way: Way) -> Basis:
    places = np.concatenate([way.curve.points, *(end.line[:8] for end in way.ends)])
    seen = _box(places, FARTHEST + max(end.half for end in way.ends) + _FACE)
    return Basis(seen, _box(way.path[:, ::-1], 0.0), walls=False)


def _about(drawn: Drawn) -> Box:
    return _box(drawn.looked, drawn.margin)


def _both(one: Box, other: Box) -> Box:
    return min(one[0], other[0]), min(one[1], other[1]), max(one[2], other[2]), max(one[3], other[3])


def _box(places: NDArray[np.float64] | NDArray[np.int32], margin: float) -> Box:
    """Box about places ``(n, 2)`` of x and y."""
    low, high = np.floor(places.min(axis=0) - margin), np.ceil(places.max(axis=0) + margin)
    return int(low[1]), int(low[0]), int(high[1]) + 1, int(high[0]) + 1
