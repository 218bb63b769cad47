"""One way to close one hole: its path, and what tells whether it is right."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fill.context import FEATURES as FEATURES
from fill.context import features
from fill.scene import Scene
from fill.segments import End
from fill.ways import Way


@dataclass(frozen=True, slots=True, eq=False)
class Candidate:
    """A way to close a hole between two ``ends``, or, if it is a ``side``, an end and the side of a wall.

    ``path`` ``(n, 2)`` int32 of row and column, joined edge to edge from inside the one wall to inside the other;
    ``way`` as it was drawn; ``features`` after ``FEATURES``; ``half_a``, ``half_b`` half the thickness at either end;
    ``start`` and ``finish`` x and y of both ends, in cells; ``ends`` the two as they were found, where a wall is met on
    its side the place that is met.
    """

    curve: str
    path: NDArray[np.int32]
    way: Way
    gap: float
    features: NDArray[np.float64]
    half_a: float
    half_b: float
    start: tuple[float, float]
    finish: tuple[float, float]
    ends: tuple[End, End]
    side: bool

    @property
    def joined(self) -> tuple[End, ...]:
        """The true ends that it joins: no other candidate can have them too."""
        return self.ends[:1] if self.side else self.ends


def closer_partners(ways: Sequence[Way]) -> list[float]:
    """Return for each way how much nearer than its own the nearest partners of its ends are: logarithms, summed."""
    number: dict[End, int] = {}
    one = np.array([number.setdefault(way.ends[0], len(number)) for way in ways], np.int64)
    other = np.array([-1 if way.side else number.setdefault(way.ends[1], len(number)) for way in ways], np.int64)
    gap = np.array([way.chord.gap for way in ways])
    nearest = np.full(len(number) + 1, np.inf)
    np.minimum.at(nearest, one, gap)
    np.minimum.at(nearest, other, np.where(other >= 0, gap, np.inf))
    own = np.maximum(gap, 1.0)
    closer = [np.log(own / np.maximum(np.minimum(nearest[ends], own), 0.5)) for ends in (one, other)]
    told: list[float] = (closer[0] + np.where(other >= 0, closer[1], 0.0)).tolist()
    return told


def judged(ways: Sequence[Way], scene: Scene, closer: Sequence[float]) -> list[Candidate]:
    """Make ways candidates; ``closer`` tells of each how near other partners of its ends are."""
    told = features(ways, scene, closer)
    return [_candidate(way, each) for way, each in zip(ways, told, strict=True)]


def _candidate(way: Way, told: NDArray[np.float64]) -> Candidate:
    a, b = way.ends
    return Candidate(
        curve=way.curve.name,
        path=way.path,
        way=way,
        gap=way.chord.gap,
        features=told,
        half_a=a.half,
        half_b=b.half,
        start=(a.x, a.y),
        finish=(b.x, b.y),
        ends=way.ends,
        side=way.side,
    )
