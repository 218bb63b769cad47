"""School: a belief is examined on the site's own walls and taught by what it got wrong."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fill.certainty import Belief, cell_features, falling
from fill.closing import Closed, close_holes
from fill.knockout import Exam, knock_out, near_wall
from fill.segments import find_walls
from mapping.values import OCCUPIED

_EXAMS: Final = 2
_HOLES: Final = 10  # knocked out at a time
_OPENING: Final = 0.3  # most fills are of holes: a wall drawn across blanked water counts less than one
_WITNESSES: Final = 3.0  # the cells of one hole are right or wrong together: they count as so many


@dataclass(frozen=True, slots=True)
class Judged:
    """A fill that was examined: which of its cells ``(n,)`` were right, and how much the verdict counts."""

    closed: Closed
    right: NDArray[np.bool_]
    count: float


@dataclass(frozen=True, slots=True)
class Lessons:
    """Outcomes of fills that were examined.

    ``features`` ``(n, k)``, ``right`` and ``count`` ``(n,)`` of whole fills; ``cell_features`` ``(m, 3)``,
    ``cell_right`` and ``cell_count`` ``(m,)`` of their cells.
    """

    features: NDArray[np.float64]
    right: NDArray[np.float64]
    count: NDArray[np.float64]
    cell_features: NDArray[np.float64]
    cell_right: NDArray[np.float64]
    cell_count: NDArray[np.float64]


def learn(state: NDArray[np.uint8], longest: float, prior: Belief, random: np.random.Generator) -> Belief:
    """Teach ``prior`` by holes knocked into ``state``, blind through the whole pipeline."""
    lessons = examine(state, longest, prior, random)
    if not len(lessons.right):
        return prior
    return Belief(
        prior.hole.taught(lessons.features, lessons.right, lessons.count),
        falling(prior.cell, lessons.cell_features, lessons.cell_right, lessons.cell_count),
    )


def examine(state: NDArray[np.uint8], longest: float, belief: Belief, random: np.random.Generator) -> Lessons:
    """Knock holes out, close them, and compare with what had stood there."""
    walls = find_walls(state == OCCUPIED)
    near = near_wall(state)
    judged: list[Judged] = []
    for _ in range(_EXAMS):
        exam = knock_out(state, walls, longest, _HOLES, random)
        if exam.holes:
            judged += [
                each for closed in close_holes(exam.state, longest, belief.hole) for each in _judge(closed, exam, near)
            ]
    return _lessons(judged, len(belief.hole.weights))


def _judge(closed: Closed, exam: Exam, near: NDArray[np.bool_]) -> list[Judged]:
    """One verdict, or none where the fill closes a hole that the site has of its own."""
    rows, cols = closed.cells.T
    hole, opening = bool(exam.wall[rows, cols].any()), bool(exam.water[rows, cols].any())
    if exam.zone[rows, cols].mean() <= 0.5 or not (hole or opening):
        return []
    return [Judged(closed, near[rows, cols], 1.0 if hole else _OPENING)]


def _lessons(judged: list[Judged], width: int) -> Lessons:
    if not judged:
        return Lessons(*(np.zeros(shape) for shape in ((0, width), 0, 0, (0, 3), 0, 0)))
    sizes = np.array([len(each.closed.cells) for each in judged])
    chances = np.array([each.closed.chance for each in judged])
    counts = np.array([each.count for each in judged])
    return Lessons(
        np.stack([each.closed.candidate.features for each in judged]),
        np.array([each.right.all() for each in judged], np.float64),
        counts,
        cell_features(np.repeat(chances, sizes), np.concatenate([each.closed.away for each in judged])),
        np.concatenate([each.right for each in judged]).astype(np.float64),
        np.repeat(counts * np.minimum(1.0, _WITNESSES / sizes), sizes),
    )
