"""Why holes are not closed right: no way was drawn, none of those drawn is right, or another was taken."""

from __future__ import annotations

import multiprocessing
from collections import Counter
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from fill.candidates import Candidate
from fill.closing import THRESHOLD, close_holes, fill_cells, open_walls
from fill.matching import asked, candidates, gain
from fill.prior import prior
from mapping.values import OCCUPIED
from tools.bench.holes_figures import GAPS
from tools.bench.holes_judge import COVERED, Proposal, judge
from tools.bench.holes_loss import LONGEST, Damaged

Row = dict[str, str | int | float]

RIGHT: Final = "closed right"
_NONE: Final = "no way drawn"
_WRONG: Final = "no way drawn is right"
_SEVERAL: Final = "several ways needed"
_UNSURE: Final = "right way too unsure"
_OTHER: Final = "another way taken"
_CAUSES: Final = (RIGHT, _NONE, _WRONG, _SEVERAL, _UNSURE, _OTHER)
_REACH: Final = LONGEST + 2.0
_EIGHT: Final = np.ones((3, 3), np.int8)
_WORKERS: Final = 2


@dataclass(frozen=True, slots=True)
class _Try:
    """One way, drawn alone: whether all its cells at a loss are ``right``, what it ``covers``, and its ``gain``."""

    right: bool
    covers: NDArray[np.bool_]
    gain: float


def measure_causes(cases: Sequence[Damaged]) -> Iterator[Row]:
    """Yield for each length of gap how many holes there are, and the share of each cause."""
    with ProcessPoolExecutor(_WORKERS, multiprocessing.get_context("spawn")) as pool:
        found = [each for part in pool.map(causes, cases, chunksize=4) for each in part]
    for name, least, most in GAPS:
        counted = Counter(cause for gap, cause in found if least <= gap <= most)
        total = counted.total()
        if total:
            row: Row = {"gap": name, "holes": total}
            yield row | {cause: round(counted[cause] / total, 3) for cause in _CAUSES}


def causes(case: Damaged) -> list[tuple[float, str]]:
    """Gap and cause of each hole of a damaged piece."""
    seen = case.seen
    belief = prior()
    filled = np.zeros(seen.shape, bool)
    for closed in close_holes(seen, _REACH, belief.hole):
        filled[closed.cells[:, 0], closed.cells[:, 1]] = True
    verdicts = judge(case, Proposal(filled, None)).losses
    ways = candidates(open_walls(seen == OCCUPIED, seen), seen, _REACH)
    chances = belief.hole.chance(np.stack([way.features for way in ways])) if ways else np.zeros(0)
    gains = [gain(chance, asked(way, THRESHOLD)) for way, chance in zip(ways, chances.tolist(), strict=True)]
    tries = _tries(case, ways, gains)
    return [
        (verdict.loss.gap, RIGHT if verdict.good else _cause(tries[index]))
        for index, verdict in enumerate(verdicts)
        if not verdict.loss.opening
    ]


def _tries(case: Damaged, ways: Sequence[Candidate], gains: Sequence[float]) -> list[list[_Try]]:
    """Return for each loss what each of the ways that touch it would do there."""
    tries: list[list[_Try]] = [[] for _ in case.losses]
    wall = ndimage.binary_dilation(case.truth == OCCUPIED, _EIGHT)
    for way, worth in zip(ways, gains, strict=True):
        parts = fill_cells(way, case.seen, case.seen == OCCUPIED)
        if not parts:
            continue
        rows, cols = np.concatenate(parts).T
        owner = case.owner[rows, cols]
        layer = np.zeros(wall.shape, bool)
        layer[rows, cols] = True
        near = ndimage.binary_dilation(layer, _EIGHT)
        for index in np.unique(owner[owner >= 0]).tolist():
            line = case.losses[index].line
            right = bool(wall[rows, cols][owner == index].all())
            tries[index].append(_Try(right, near[line[:, 0], line[:, 1]], worth))
    return tries


def _cause(tries: Sequence[_Try]) -> str:
    if not tries:
        return _NONE
    right = [each for each in tries if each.right]
    whole = [each for each in right if each.covers.mean() >= COVERED]
    if whole:
        return _OTHER if max(each.gain for each in whole) > 0.0 else _UNSURE
    together = np.any([each.covers for each in right], axis=0) if right else np.zeros(1, bool)
    return _SEVERAL if together.mean() >= COVERED else _WRONG
