"""School: a belief is examined on the site's own walls and taught by what it got wrong."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fill.certainty import Belief
from fill.closing import close_holes
from fill.knockout import SIZES, Place, knock_out, near_wall
from fill.witness import witness

_REACH: Final = 2.0  # of a hole's size: ends so far apart are candidates in its exam
_OPENING: Final = 0.3  # most fills are of holes: a wall drawn across blanked water counts less than one
_WITNESSES: Final = 3.0  # the cells of one hole are right or wrong together: they count as so many
_HELD: Final = 4.0  # log-odds of a lesson are held within these


@dataclass(frozen=True, slots=True)
class Lesson:
    """One exam's outcome: ``log_odds`` ``(n,)`` told of the cells filled, and which of them were ``right`` ``(n,)``."""

    size: int
    opening: bool
    log_odds: NDArray[np.float64]
    right: NDArray[np.bool_]


def hold(state: NDArray[np.uint8], place: Place, belief: Belief) -> Lesson | None:
    """Hold one exam in its window ``state``, blind through the whole pipeline; None where nothing can be taken out."""
    exam = knock_out(state, place)
    if exam is None:
        return None
    near = near_wall(state)
    closed = [
        each
        for each in close_holes(exam.state, max(8.0, _REACH * place.size), belief.hole)
        if exam.gone[tuple(each.cells.T)].any() and exam.zone[tuple(each.cells.T)].mean() > 0.5
    ]
    told = [belief.cell.log_odds(*witness(each, exam.state)) for each in closed]
    right = [near[tuple(each.cells.T)] for each in closed]
    none = np.zeros(0)
    return Lesson(place.size, exam.opening, np.concatenate([none, *told]), np.concatenate([none.astype(bool), *right]))


def taught(belief: Belief, lessons: Sequence[Lesson], gaps: Sequence[float]) -> Belief:
    """Teach ``belief`` the site's level and slope.

    Exams count as often as holes of their size really are there: ``gaps`` are those of the site's own holes, in cells.
    """
    kept = [each for each in lessons if len(each.right)]
    if not kept:
        return belief
    share = _shares(gaps)
    counts = [
        np.full(len(each.right), share[SIZES.index(each.size)] * min(1.0, _WITNESSES / len(each.right)))
        * (_OPENING if each.opening else 1.0)
        for each in kept
    ]
    told = np.clip(np.concatenate([each.log_odds for each in kept]), -_HELD, _HELD)
    right = np.concatenate([each.right for each in kept]).astype(np.float64)
    features = np.stack([np.ones_like(told), told], axis=1)
    return dataclasses.replace(belief, site=belief.site.taught(features, right, np.concatenate(counts)))


def _shares(gaps: Sequence[float]) -> NDArray[np.float64]:
    """How often each size of hole is there beside the mean; one of each is added, so that none is never."""
    nearest = np.argmin(np.abs(np.log(np.array(SIZES)) - np.log(np.maximum(np.array(gaps), 1.0))[:, None]), axis=1)
    count = np.bincount(nearest.astype(np.int64), minlength=len(SIZES)) + 1.0
    return np.asarray(count / count.mean(), np.float64)
