"""What became of fills in damaged maps: the lessons that the prior of certainties is fitted to."""

from __future__ import annotations

import multiprocessing
import zlib
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from fill.candidates import FEATURES
from fill.certainty import DESIGN, design_of
from fill.closing import close_holes, fill_cells, open_walls
from fill.matching import candidates
from fill.witness import distances, witness
from mapping.trees import Trees
from mapping.values import FREE, OCCUPIED
from tools.bench.holes_damage import damage
from tools.bench.holes_gates import shut
from tools.bench.holes_judge import COVERED
from tools.bench.holes_loss import ELSEWHERE, LONGEST, UNJUDGED, Damaged
from tools.bench.holes_maps import pieces, read_state, sources
from tools.bench.holes_rooms import drawn_rooms
from tools.bench.holes_sites import drawn_sites

_REACH: Final = LONGEST + 2.0
_EIGHT: Final = np.ones((3, 3), np.int8)
_WORKERS: Final = 2
_ROOMS: Final = 4
_FAR: Final = 0.8  # what a candidate far from any loss is worth as a lesson, beside one of a hole
_OPENING: Final = 4.0  # and one that would shut an opening
_PARTLY: Final = 0.5  # and one that is right, but leaves a part of the hole open


@dataclass(frozen=True, slots=True)
class Case:
    """One damaged piece of ``place``, a real map or an emulated site."""

    place: str
    real: bool
    damaged: Damaged

    @property
    def fold(self) -> str:
        """What is left out with it when a model is judged: its map, or all that is emulated."""
        return self.place if self.real else "emulated"


@dataclass(frozen=True, slots=True)
class Tried:
    """Candidates ``(n, k)`` of one case by their features, which of them were ``right`` ``(n,)``, and its ``worth``."""

    features: NDArray[np.float64]
    right: NDArray[np.bool_]
    worth: NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Filling:
    """Cells filled in one case.

    ``design`` ``(m, d)``, which of them were ``right`` ``(m,)``, of which ``fill`` ``(m,)``, and ``away`` ``(m,)``
    cells from what was measured.
    """

    design: NDArray[np.float32]
    right: NDArray[np.bool_]
    fill: NDArray[np.int64]
    away: NDArray[np.float64]


def cases(data: Path, seeds: Sequence[int], count: int) -> list[Case]:
    """Damage ``count`` pieces of every map of the tune half and one of every emulated site, once a seed."""
    return [case for seed in seeds for case in _cases(data, seed, count)]


def tried(found: Sequence[Case]) -> list[Tried]:
    """Judge every candidate, whatever would be made of it."""
    with _pool() as pool:
        return list(pool.map(_tried, found, chunksize=4))


def filled(found: Sequence[Case], models: Mapping[str, Trees]) -> list[Filling]:
    """Close the holes by models that did not see the case's fold, and judge every filled cell near a loss."""
    with _pool() as pool:
        return list(pool.map(_filled, found, [models[case.fold] for case in found], chunksize=4))


def _pool() -> ProcessPoolExecutor:
    return ProcessPoolExecutor(_WORKERS, multiprocessing.get_context("spawn"))


def _tried(case: Case) -> Tried:
    damaged = case.damaged
    seen, wall, near = damaged.seen, damaged.seen == OCCUPIED, _near(damaged)
    features, verdicts = [], []
    for each in candidates(open_walls(wall, seen), seen, _REACH):
        parts = fill_cells(each, seen, wall)
        verdict = _verdict(np.concatenate(parts), damaged, near) if parts else None
        if verdict is not None:
            features.append(each.features)
            verdicts.append(verdict)
    right, worth = np.array(verdicts, np.float64).reshape(-1, 2).T
    return Tried(np.array(features).reshape(-1, len(FEATURES)), right > 0.5, worth)


def _verdict(cells: NDArray[np.int32], damaged: Damaged, near: NDArray[np.bool_]) -> tuple[bool, float] | None:
    """Whether a fill is right, and what that is worth; None where too much is gone to judge."""
    rows, cols = cells.T
    loss = int(np.bincount(damaged.owner[rows, cols] - UNJUDGED).argmax()) + UNJUDGED
    if loss == UNJUDGED:
        return None
    if loss == ELSEWHERE:
        return False, _FAR
    if damaged.losses[loss].opening:
        solid = damaged.truth != FREE
        solid[rows, cols] = True
        return False, _OPENING if shut(damaged.losses[loss].banks, solid) else 1.0
    if not near[rows, cols].all():
        return False, 1.0
    return True, 1.0 if _covers(cells, damaged.losses[loss].line, damaged.seen.shape) else _PARTLY


def _covers(cells: NDArray[np.int32], line: NDArray[np.int64], shape: tuple[int, ...]) -> bool:
    """Whether a fill closes the whole of a hole."""
    layer = np.zeros(shape, bool)
    layer[cells[:, 0], cells[:, 1]] = True
    return float(ndimage.binary_dilation(layer, _EIGHT)[line[:, 0], line[:, 1]].mean()) >= COVERED


def _filled(case: Case, model: Trees) -> Filling:
    damaged = case.damaged
    seen, near = damaged.seen, _near(damaged)
    designs, right, fill, away = (
        [np.zeros((0, len(DESIGN)))],
        [np.zeros(0, bool)],
        [np.zeros(0, np.int64)],
        [np.zeros(0)],
    )
    for number, closed in enumerate(close_holes(seen, _REACH, model)):
        rows, cols = closed.cells.T
        ours = damaged.owner[rows, cols] >= 0
        hole, cells = witness(closed, seen)
        designs.append(design_of(hole, cells)[ours])
        right.append(near[rows, cols][ours])
        fill.append(np.full(int(ours.sum()), number))
        away.append(distances(closed, cells)[ours])
    design, told = np.concatenate(designs).astype(np.float32), np.concatenate(right)
    return Filling(design, told, np.concatenate(fill), np.concatenate(away))


def _near(damaged: Damaged) -> NDArray[np.bool_]:
    return np.asarray(ndimage.binary_dilation(damaged.truth == OCCUPIED, _EIGHT), np.bool_)


def _cases(data: Path, seed: int, count: int) -> Iterator[Case]:
    maps = ((source.name, True, read_state(source.path)) for source in sources(data, "tune"))
    random = np.random.default_rng(seed)
    sites = ((name, False, state) for name, state in (*drawn_sites(random), *drawn_rooms(_ROOMS, random)))
    for place, real, state in (*maps, *sites):
        random = np.random.default_rng([seed, zlib.crc32(place.encode())])
        for number, piece in enumerate(pieces(state, count if real else 1, random)):
            damaged = damage(f"{place}-{number}", piece, random)
            if damaged.losses:
                yield Case(place, real, damaged)
