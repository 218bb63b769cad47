"""What became of fills in damaged maps: the lessons that the prior of certainties is fitted to."""

from __future__ import annotations

import multiprocessing
import zlib
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from fill.certainty import design_of
from fill.closing import close_holes, fill_cells, open_walls
from fill.matching import candidates
from fill.prior import prior
from fill.witness import distances, witness
from mapping.values import OCCUPIED
from tools.bench.holes_damage import damage
from tools.bench.holes_loss import LONGEST, Damaged
from tools.bench.holes_maps import pieces, read_state, sources
from tools.bench.holes_sites import drawn_sites

_REACH: Final = LONGEST + 2.0
_EIGHT: Final = np.ones((3, 3), np.int8)
_WORKERS: Final = 2


@dataclass(frozen=True, slots=True)
class Outcomes:
    """Outcomes of one damaged piece of ``place``, a map or an emulated site.

    ``candidates`` ``(n, k)`` by their features, and which of them were ``right`` ``(n,)``; ``cells`` ``(m, d)`` by
    their design, which of them were ``cell_right`` ``(m,)``, of which ``fill`` ``(m,)``, and ``away`` ``(m,)`` cells
    from what was measured.
    """

    place: str
    real: bool
    candidates: NDArray[np.float64]
    right: NDArray[np.bool_]
    cells: NDArray[np.float32]
    cell_right: NDArray[np.bool_]
    fill: NDArray[np.int64]
    away: NDArray[np.float64]


def outcomes(data: Path, seeds: Sequence[int], count: int) -> list[Outcomes]:
    """Damage ``count`` pieces of every map of the tune half and every emulated site, once a seed, and fill them."""
    cases = [case for seed in seeds for case in _cases(data, seed, count)]
    with ProcessPoolExecutor(_WORKERS, multiprocessing.get_context("spawn")) as pool:
        return list(pool.map(outcome, cases, chunksize=4))


def outcome(case: tuple[str, bool, Damaged]) -> Outcomes:
    """Fill one damaged piece and judge every candidate and every filled cell near a loss."""
    place, real, damaged = case
    seen, wall = damaged.seen, damaged.seen == OCCUPIED
    near = np.asarray(ndimage.binary_dilation(damaged.truth == OCCUPIED, _EIGHT), np.bool_)
    walls = open_walls(wall, seen)
    features, right = [], []
    for each in candidates(walls, seen, _REACH):
        for rows, cols in (part.T for part in fill_cells(each, seen, wall)[:1]):
            if np.mean(damaged.owner[rows, cols] >= 0) > 0.5:
                features.append(each.features)
                right.append(bool(near[rows, cols].all()))
    designs, cell_right, fill, away = [], [], [], []
    for number, closed in enumerate(close_holes(seen, _REACH, prior().hole)):
        rows, cols = closed.cells.T
        ours = damaged.owner[rows, cols] >= 0
        hole, cells = witness(closed, seen)
        designs.append(design_of(hole, cells)[ours])
        cell_right.append(near[rows, cols][ours])
        fill.append(np.full(int(ours.sum()), number))
        away.append(distances(closed, cells)[ours])
    return Outcomes(
        place, real, np.array(features), np.array(right, bool), _joined(designs).astype(np.float32),
        _joined(cell_right).astype(bool), _joined(fill).astype(np.int64), _joined(away),
    )  # fmt: skip


def _joined(parts: list[NDArray[np.float64]]) -> NDArray[np.float64]:
    return np.concatenate(parts) if parts else np.zeros(0)


def _cases(data: Path, seed: int, count: int) -> Iterator[tuple[str, bool, Damaged]]:
    maps = ((source.name, True, read_state(source.path)) for source in sources(data, "tune"))
    sites = ((name, False, state) for name, state in drawn_sites(np.random.default_rng(seed)))
    for place, real, state in (*maps, *sites):
        random = np.random.default_rng([seed, zlib.crc32(place.encode())])
        for number, piece in enumerate(pieces(state, count if real else 1, random)):
            damaged = damage(f"{place}-{number}", piece, random)
            if damaged.losses:
                yield place, real, damaged
