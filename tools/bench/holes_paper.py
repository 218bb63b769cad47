"""The paper's own measure (Forrester et al. 2013, Table 1): of the cells that were filled, how many had been occupied.

Three readings, on pieces of real maps as large as the paper's grids, cell for cell and without tolerance: the paper's,
in which the method is told where the ends of the hole are, it learns and is judged on the same site, and only middles
of long segments are knocked out; and two blind ones, in which a third as much of a wall is knocked out as stands on
either side, and the paper's whole loop or ours has to find, match and fill.  Misses do not count in any of them, and
thick walls forgive: their mean thickness stands beside.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from fill.paper_curve import knock_outs
from mapping.values import FREE, OCCUPIED, UNKNOWN
from tools.bench.holes_maps import Source, read_state
from tools.bench.holes_methods import Method, ours, paper_as_printed
from tools.bench.holes_walk import centre_lines, walk_both_ways

Row = dict[str, str | int | float]

GRIDS: Final = {
    "Case Cutietta": (120, 120, 0.94),
    "College Garden": (100, 320, 0.89),
    "Gatto Pardo": (132, 109, 0.75),
    "Keyhole": (150, 100, 0.87),
    "Site 8": (160, 120, 0.85),
    "Tas Silg": (187, 175, 0.83),
    "Qanat": (562, 162, 0.68),
}
"""Rows, columns and share of true positives of the paper's models, by their names."""
_PUBLISHED_MEAN: Final = 0.83
_HOLES: Final = 12
_TRIES: Final = 20
_ROUNDS: Final = 2
_LENGTHS: Final = (3, 13)
_APART: Final = 10.0
_FEWEST: Final = 200  # wall cells
_EIGHT: Final = np.ones((3, 3), np.int8)


@dataclass(frozen=True, slots=True)
class _Count:
    right: int
    filled: int


def measure_as_paper(maps: list[Source], seed: int) -> Iterator[Row]:
    """Yield a row for each of the paper's grid sizes, taken from the maps in turn, and one for all."""
    random = np.random.default_rng(seed)
    states = [read_state(source.path) for source in maps]
    rows = []
    for number, (name, (high, wide, published)) in enumerate(GRIDS.items()):
        index = number % len(maps)
        rows.append(_measured(_window(states[index], high, wide, random), random))
        yield {"size_of": name, "map": maps[index].name, "published": published, **rows[-1]}
    keys = dict.fromkeys(key for row in rows for key in row)
    mean = {key: round(float(np.mean([row[key] for row in rows if key in row])), 3) for key in keys}
    yield {"size_of": "mean", "map": "all", "published": _PUBLISHED_MEAN, **mean}


def _measured(state: NDArray[np.uint8], random: np.random.Generator) -> dict[str, float]:
    wall = state == OCCUPIED
    told = knock_outs(wall, random)
    depth = ndimage.distance_transform_edt(wall)[centre_lines(wall)]
    thickness = 2.0 * float(depth.mean()) - 1.0 if len(depth) else float("nan")
    shares = {"thickness": thickness, "paper, ends told": told.positives}
    counts: dict[str, list[_Count]] = {"paper, blind": [], "ours, blind": []}
    for _ in range(_ROUNDS):
        seen, gone = _knocked_out(state, random)
        for name, method in zip(counts, (paper_as_printed, ours), strict=True):
            counts[name].append(_counted(method, seen, gone, wall))
    for name, found in counts.items():
        filled = sum(each.filled for each in found)
        shares[name] = sum(each.right for each in found) / filled if filled else float("nan")
    return {key: round(value, 3) for key, value in shares.items() if not np.isnan(value)}


def _counted(method: Method, seen: NDArray[np.uint8], gone: NDArray[np.bool_], wall: NDArray[np.bool_]) -> _Count:
    """Cells filled about what was knocked out, and those of them that had been wall."""
    if not gone.any():
        return _Count(0, 0)
    about = ndimage.distance_transform_edt(~gone) <= _APART / 2
    filled = method(seen).filled & about & (seen != OCCUPIED)
    return _Count(int((filled & wall).sum()), int(filled.sum()))


def _knocked_out(state: NDArray[np.uint8], random: np.random.Generator) -> tuple[NDArray[np.uint8], NDArray[np.bool_]]:
    """Take pieces out of walls, and nothing else; return what is left and the cells that went."""
    wall = state == OCCUPIED
    centre = centre_lines(wall)
    thick = ndimage.distance_transform_edt(wall)
    gone = np.zeros(state.shape, bool)
    starts = np.argwhere(centre)
    for _ in range(_TRIES * _HOLES if len(starts) else 0):
        row, col = starts[random.integers(len(starts))].tolist()
        path = walk_both_ways((row, col), centre, int(random.integers(*_LENGTHS, endpoint=True)), random)
        if path is None:
            continue
        line = np.ones(state.shape, bool)
        line[tuple(np.array(path).T)] = False
        away = ndimage.distance_transform_edt(line)
        if not (gone & (away <= 2 * _APART)).any():
            gone |= wall & (away <= thick[~line].max() + 0.5)
        if int(ndimage.label(gone, _EIGHT)[1]) == _HOLES:
            break
    return np.where(gone, UNKNOWN, state).astype(np.uint8), gone


def _window(state: NDArray[np.uint8], high: int, wide: int, random: np.random.Generator) -> NDArray[np.uint8]:
    """Cut a window of a size, either way round, with walls and water in it; the fullest of a few."""
    best, most = state[:high, :wide], -1
    for _ in range(_TRIES):
        rows, cols = (high, wide) if random.random() < 0.5 else (wide, high)
        row = int(random.integers(max(state.shape[0] - rows, 0) + 1))
        col = int(random.integers(max(state.shape[1] - cols, 0) + 1))
        piece = state[row : row + rows, col : col + cols]
        count = int((piece == OCCUPIED).sum())
        if count > most and (piece == FREE).mean() > 0.1:
            best, most = piece, count
        if most >= _FEWEST:
            break
    return np.ascontiguousarray(best)
