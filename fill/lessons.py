"""School: a belief is examined on the site's own walls and taught by what it got wrong."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fill.certainty import Belief, cell_features
from fill.closing import Closed, close_holes
from fill.knockout import Exam, knock_out, near_wall
from fill.segments import find_walls
from mapping.values import OCCUPIED

_EXAMS: Final = 2
_HOLES: Final = 10  # knocked out at a time
_WITNESSES: Final = 3.0  # the cells of one hole are right or wrong together: they count as so many


@dataclass(frozen=True, slots=True)
class Lessons:
    """Outcomes of fills that were examined.

    ``features`` ``(n, k)`` and ``right`` ``(n,)`` of whole fills; ``cell_features`` ``(m, 3)``, ``cell_right`` and
    ``cell_weight`` ``(m,)`` of their cells.
    """

    features: NDArray[np.float64]
    right: NDArray[np.float64]
    cell_features: NDArray[np.float64]
    cell_right: NDArray[np.float64]
    cell_weight: NDArray[np.float64]


def learn(state: NDArray[np.uint8], longest: float, prior: Belief, random: np.random.Generator) -> Belief:
    """Teach ``prior`` by holes knocked into ``state``, blind through the whole pipeline."""
    lessons = examine(state, longest, prior, random)
    if not len(lessons.right):
        return prior
    return Belief(
        prior.hole.taught(lessons.features, lessons.right, np.ones(len(lessons.right))),
        prior.cell.taught(lessons.cell_features, lessons.cell_right, lessons.cell_weight),
    )


def examine(state: NDArray[np.uint8], longest: float, belief: Belief, random: np.random.Generator) -> Lessons:
    """Knock holes out, close them, and compare with what had stood there."""
    walls = find_walls(state == OCCUPIED)
    near = near_wall(state)
    judged: list[tuple[Closed, NDArray[np.bool_]]] = []
    for _ in range(_EXAMS):
        exam = knock_out(state, walls, longest, _HOLES, random)
        if exam.holes:
            closed = close_holes(exam.state, longest, belief.hole)
            judged += [(each, near[each.cells[:, 0], each.cells[:, 1]]) for each in closed if _inside(each, exam)]
    return _lessons(judged, len(belief.hole.weights))


def _inside(closed: Closed, exam: Exam) -> bool:
    """Whether a fill closes what was taken out, and not a hole that the site has of its own."""
    ends = np.rint([closed.candidate.start, closed.candidate.finish]).astype(np.int64)
    rows, cols = np.clip(ends[:, ::-1], 0, np.array(exam.zone.shape) - 1).T
    return bool(exam.zone[closed.cells[:, 0], closed.cells[:, 1]].mean() > 0.5 and exam.rim[rows, cols].any())


def _lessons(judged: list[tuple[Closed, NDArray[np.bool_]]], width: int) -> Lessons:
    if not judged:
        return Lessons(np.zeros((0, width)), np.zeros(0), np.zeros((0, 3)), np.zeros(0), np.zeros(0))
    chances = np.concatenate([np.full(len(each.cells), each.chance) for each, _ in judged])
    return Lessons(
        np.stack([each.candidate.features for each, _ in judged]),
        np.array([right.all() for _, right in judged], np.float64),
        cell_features(chances, np.concatenate([each.away for each, _ in judged])),
        np.concatenate([right for _, right in judged]).astype(np.float64),
        np.concatenate([np.full(len(each.cells), min(1.0, _WITNESSES / len(each.cells))) for each, _ in judged]),
    )
