"""The paper's own measure (Forrester et al. 2013, Table 1): of the cells that were filled, how many had been occupied.

On emulated sites of the kinds that the paper has, and on pieces of real maps as large as its grids, cell for cell and
without tolerance.  In the paper's sense the method is told where the ends of the hole are: its own polynomials learn
and are judged on middles of long segments, and ours fills pieces of walls that leave at least six cells on both sides.
Blind, the paper's whole loop or ours has to find, match and fill.  Misses do not count in any of them, and thick walls
forgive: their mean thickness stands beside.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from mapping.values import FREE, OCCUPIED, UNKNOWN
from tools.bench.holes_maps import Source, read_state
from tools.bench.holes_methods import ours, paper_as_printed
from tools.bench.holes_printed import knock_outs
from tools.bench.holes_sites import draw_site
from tools.bench.holes_told import fill_told
from tools.bench.holes_walk import centre_lines, walk_both_ways
from tools.emulator.site import SITES

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
_SITES: Final = {
    "Case Cutietta": "house",
    "College Garden": "hall",
    "Gatto Pardo": "bell",
    "Keyhole": "keyhole",
    "Site 8": "cave",
    "Tas Silg": "loop",
    "Qanat": "gallery",
}
"""The emulated site of each model's kind."""
_CELL_M: Final = 0.08
_THICK: Final = 2
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
    """Yield a row for each of the paper's models, on its emulated kind and on maps in turn, and one for all of each."""
    random = np.random.default_rng(seed)
    turn = random.uniform(0.0, math.tau)
    yield from _rows({name: (site, draw_site(SITES[site](), _CELL_M, turn, _THICK, random))
                      for name, site in _SITES.items()}, random)  # fmt: skip
    states = [read_state(source.path) for source in maps]
    windows = {}
    for number, (name, (high, wide, _)) in enumerate(GRIDS.items()):
        index = number % len(maps)
        windows[name] = maps[index].name, _window(states[index], high, wide, random)
    yield from _rows(windows, random)


def _rows(grids: dict[str, tuple[str, NDArray[np.uint8]]], random: np.random.Generator) -> Iterator[Row]:
    rows = []
    for name, (place, state) in grids.items():
        rows.append(_measured(state, random))
        yield {"size_of": name, "map": place, "published": GRIDS[name][2], **rows[-1]}
    keys = dict.fromkeys(key for row in rows for key in row)
    mean = {key: round(float(np.mean([row[key] for row in rows if key in row])), 3) for key in keys}
    yield {"size_of": "mean", "map": "all", "published": _PUBLISHED_MEAN, **mean}


def _measured(state: NDArray[np.uint8], random: np.random.Generator) -> dict[str, float]:
    wall = state == OCCUPIED
    told = knock_outs(wall, random)
    depth = ndimage.distance_transform_edt(wall)[centre_lines(wall)]
    thickness = 2.0 * float(depth.mean()) - 1.0 if len(depth) else float("nan")
    shares = {"thickness": thickness, "paper, ends told": told.positives}
    counts: dict[str, list[_Count]] = {"ours, ends told": [], "paper, blind": [], "ours, blind": []}
    for _ in range(_ROUNDS):
        seen, gone = _knocked_out(state, random)
        for name, filled in (
            ("ours, ends told", fill_told(seen, gone)),
            ("paper, blind", paper_as_printed(seen).filled),
            ("ours, blind", ours(seen).filled),
        ):
            counts[name].append(_counted(filled, seen, gone, wall))
    for name, found in counts.items():
        total = sum(each.filled for each in found)
        shares[name] = sum(each.right for each in found) / total if total else float("nan")
    return {key: round(value, 3) for key, value in shares.items() if not np.isnan(value)}


def _counted(
    proposed: NDArray[np.bool_], seen: NDArray[np.uint8], gone: NDArray[np.bool_], wall: NDArray[np.bool_]
) -> _Count:
    """Cells filled about what was knocked out, and those of them that had been wall."""
    if not gone.any():
        return _Count(0, 0)
    about = ndimage.distance_transform_edt(~gone) <= _APART / 2
    filled = proposed & about & (seen != OCCUPIED)
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
