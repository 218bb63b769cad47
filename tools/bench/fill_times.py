"""What filling costs, in processor time of one core: a pass after a scan, a pass from scratch, and learning a hole.

Learning is told beside one call of ``numpy.polyfit``, cubic, for x and y together.  Ours is exams: pieces of the site's
own walls are taken out and filled blind, by the whole way from ends to fills.  The paper's learning is told the ends,
and by closed forms a hole, filled by three orders, costs a small part of a fit.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from functools import partial
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from config.schema import Fill
from fill.filler import Filler
from fill.knockout import places, window
from fill.lessons import hold
from fill.paper_learning import LEARNABLE, learn
from fill.paper_segments import find_paths
from fill.prior import prior
from fill.segments import find_walls
from mapping.values import FREE, OCCUPIED, UNKNOWN, Grid
from tools.bench.figure import Figure

_SHAPE: Final = (200, 600)
_WALLS: Final = 90
_PASSES: Final = 5
_SCANNED: Final = 10  # cells about a place that a scan tells of anew
_SIDE: Final = 8  # cells on either side of a hole of a fit
_REPEATS: Final = 9
_FITS: Final = 200


def measure(seed: int) -> Iterator[Figure]:
    """Yield the figures."""
    random = np.random.default_rng(seed)
    finished = _rooms(random)
    state = _torn(finished, random)
    filler = Filler(Fill())
    first = _grid(state)
    yield Figure("fill from scratch, 600 x 200, 90 walls", 1e3 * _seconds(lambda: filler.update(first)), "ms")
    passes = []
    for _ in range(_PASSES):
        state = _scanned(state, finished, random)
        grid = _grid(state)
        passes.append(1e3 * _seconds(partial(filler.update, grid)))
    yield Figure("fill after a scan, median (aim: 15)", float(np.median(passes)), "ms")
    told, anew = filler.update(_grid(state)), Filler(Fill()).update(_grid(state))
    same = told.certainty.tobytes() == anew.certainty.tobytes() and told.hole.tobytes() == anew.hole.tobytes()
    yield Figure("... the same to the byte as from scratch", float(same), "", "yes", bool(same))
    learning, fit = _learning(state), _fit(random)
    yield Figure("learning by blind exams, by the hole", 1e3 * learning, "ms")
    yield Figure("... in fits by numpy.polyfit", learning / fit, "fits")
    by_hole, holes = _told(state, random)
    yield Figure(f"the paper's learning by closed forms, by the hole of {holes}", 1e6 * by_hole, "us")
    yield Figure("... holes in the time of a fit by numpy.polyfit (aim: 70)", fit / by_hole, "holes")


def _learning(state: NDArray[np.uint8]) -> float:
    """Seconds of an exam in the walls of a site."""
    found = places(find_walls(state == OCCUPIED).centre, (0, 0))
    belief = prior()
    return _seconds(lambda: [hold(window(place, state), place, belief) for place in found]) / max(len(found), 1)


def _told(state: NDArray[np.uint8], random: np.random.Generator) -> tuple[float, int]:
    """Seconds by the hole of the paper's learning, from walls to tally, and the number of holes; the best of turns."""
    wall = state == OCCUPIED
    tally = learn(find_paths(wall, LEARNABLE), wall, random)
    seconds = min(_seconds(lambda: learn(find_paths(wall, LEARNABLE), wall, random)) for _ in range(_REPEATS))
    return seconds / max(tally.holes, 1), tally.holes


def _fit(random: np.random.Generator) -> float:
    """Seconds of a polynomial fit; the best of several turns."""
    place, points = np.arange(2.0 * _SIDE), random.normal(size=(2 * _SIDE, 2))
    return min(_seconds(lambda: [np.polyfit(place, points, 3) for _ in range(_FITS)]) for _ in range(_REPEATS)) / _FITS


def _rooms(random: np.random.Generator) -> NDArray[np.uint8]:
    """Rooms side by side, their walls two cells thick."""
    water = np.zeros(_SHAPE, bool)
    col = 8
    while col < _SHAPE[1] - 60:
        wide, row = int(random.integers(30, 60)), 8
        while row < _SHAPE[0] - 44:
            high = int(random.integers(28, 60))
            water[row : min(row + high, _SHAPE[0] - 8), col : col + wide] = True
            row += high + 6
        col += wide + 6
    state = np.full(_SHAPE, UNKNOWN, np.uint8)
    state[ndimage.binary_dilation(water, np.ones((3, 3), np.int8), iterations=2)] = OCCUPIED
    state[water] = FREE
    return state


def _torn(finished: NDArray[np.uint8], random: np.random.Generator) -> NDArray[np.uint8]:
    """Forget discs about walls until so many walls are left."""
    state = finished.copy()
    walls = np.argwhere(state == OCCUPIED)
    while int(ndimage.label(state == OCCUPIED, np.ones((3, 3)))[1]) < _WALLS:
        state[_disc(walls[random.integers(len(walls))], random.uniform(2.0, 6.0))] = UNKNOWN
    return state


def _scanned(state: NDArray[np.uint8], finished: NDArray[np.uint8], random: np.random.Generator) -> NDArray[np.uint8]:
    """Return the state after a scan that tells about one of the places that were forgotten."""
    lost = np.argwhere((state == UNKNOWN) & (finished == OCCUPIED))
    if not len(lost):
        return state
    return np.where(_disc(lost[random.integers(len(lost))], _SCANNED), finished, state).astype(np.uint8)


def _disc(middle: NDArray[np.int64], radius: float) -> NDArray[np.bool_]:
    rows, cols = np.ogrid[: _SHAPE[0], : _SHAPE[1]]
    return np.asarray((rows - middle[0]) ** 2 + (cols - middle[1]) ** 2 <= radius**2, np.bool_)


def _grid(state: NDArray[np.uint8]) -> Grid:
    return Grid(0.05, 0.0, 0.0, np.zeros(state.shape, np.float32), state)


def _seconds(work: Callable[[], object]) -> float:
    start = time.process_time()
    work()
    return time.process_time() - start
