"""Simulated loss on real maps: stretches of wall, shadows, and true openings of which the water was seen or not."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from mapping.values import FREE, OCCUPIED, UNKNOWN
from tools.bench.holes_gates import Gate, find_gates
from tools.bench.holes_loss import LONGEST, Damaged, Kind, Loss, owners
from tools.bench.holes_walk import Cell, centre_lines, walk_both_ways

_STRETCHES: Final = 6
_SHADOWS: Final = 2
_OPENINGS: Final = 4
_TRIES: Final = 15
_SHORTEST: Final = 3.0
_APART: Final = 12  # cells between two losses
_EIGHT: Final = np.ones((3, 3), np.int8)


@dataclass(slots=True)
class _Work:
    """A piece under damage."""

    truth: NDArray[np.uint8]
    seen: NDArray[np.uint8]
    centre: NDArray[np.bool_]
    thick: NDArray[np.float64]
    busy: NDArray[np.bool_]
    unjudged: NDArray[np.bool_]
    losses: list[Loss] = field(default_factory=list)

    def taken(self, mask: NDArray[np.bool_]) -> bool:
        return bool((ndimage.binary_dilation(mask, _EIGHT, iterations=_APART) & self.busy).any())


def damage(name: str, truth: NDArray[np.uint8], random: np.random.Generator) -> Damaged:
    """Damage a piece of a map: the same generator gives the same damage."""
    wall = truth == OCCUPIED
    work = _Work(
        truth, truth.copy(), centre_lines(wall), ndimage.distance_transform_edt(wall),
        np.zeros(truth.shape, bool), np.zeros(truth.shape, bool),
    )  # fmt: skip
    gates = find_gates(truth, work.centre)
    for number, index in enumerate(random.permutation(len(gates))[:_OPENINGS]):
        _open(work, gates[int(index)], "opening unseen" if number % 2 == 0 else "opening seen", random)
    for make, count in ((_shade, _SHADOWS), (_stretch, _STRETCHES)):
        made = 0
        for _ in range(_TRIES * count):
            made += make(work, random)
            if made == count:
                break
    return Damaged(name, truth, work.seen, tuple(work.losses), owners(truth.shape, work.losses, work.unjudged))


def _open(work: _Work, gate: Gate, kind: Kind, random: np.random.Generator) -> None:
    """Keep a true opening in mind, and of every other one forget its water."""
    rows, cols = np.ogrid[: work.truth.shape[0], : work.truth.shape[1]]
    radius = gate.gap / 2 * random.uniform(0.6, 1.1) + 1.0
    disc = (rows - gate.row) ** 2 + (cols - gate.col) ** 2 <= radius**2
    if work.taken(disc):
        return
    if kind == "opening unseen":
        work.seen[disc & (work.truth == FREE)] = UNKNOWN
    work.busy |= disc
    work.losses.append(Loss(kind, gate.line, gate.gap, gate.banks))


def _stretch(work: _Work, random: np.random.Generator) -> bool:
    """Remove 3 to 40 cells of wall, and as a sonar would that missed it, some of the water before it."""
    starts = np.argwhere(work.centre)
    if not len(starts):
        return False
    length = round(math.exp(random.uniform(math.log(_SHORTEST), math.log(LONGEST))))
    row, col = starts[random.integers(len(starts))].tolist()
    path = walk_both_ways((row, col), work.centre, length, random)
    if path is None:
        return False
    line = _mask(path, work.centre.shape)
    if work.taken(line):
        return False
    wall, to_line = _wall_about(work, line)
    halo = (0.0, random.uniform(1.0, 5.0), length / 2 + 1.0)[int(random.integers(3))]
    water = (to_line <= halo) & (work.truth == FREE)
    work.seen[wall | water] = UNKNOWN
    work.busy |= line
    work.losses.append(Loss("stretch", np.array(path), float(len(path)), np.zeros((0, 3), np.int64)))
    return True


def _shade(work: _Work, random: np.random.Generator) -> bool:
    """Forget the sector behind something that stands between the sonar and the wall."""
    water = np.argwhere(work.truth == FREE)
    if not len(water):
        return False
    row, col = water[random.integers(len(water))].tolist()
    rows, cols = np.ogrid[: work.truth.shape[0], : work.truth.shape[1]]
    away = np.hypot(rows - row, cols - col)
    middle = random.uniform(-math.pi, math.pi)
    off = np.abs((np.arctan2(rows - row, cols - col) - middle + math.pi) % math.tau - math.pi)
    near = random.uniform(8.0, 40.0)
    shade = (off <= math.radians(random.uniform(2.0, 14.0))) & (away > near) & (away < near + 70.0)
    lost = shade & work.centre
    if work.taken(shade) or not lost.any():
        return False
    parts, count = ndimage.label(lost, _EIGHT)
    lines = [np.argwhere(parts == number) for number in range(1, count + 1)]
    kept = [line for line in lines if _SHORTEST <= len(line) <= LONGEST and _stands_on(work, line, shade)]
    if not kept:
        return False
    work.seen[shade] = UNKNOWN
    work.busy |= shade
    work.unjudged |= shade
    work.losses += [Loss("shadow", line, float(len(line)), np.zeros((0, 3), np.int64)) for line in kept]
    return True


def _stands_on(work: _Work, line: NDArray[np.int64], shade: NDArray[np.bool_]) -> bool:
    """Whether a lost line goes on outside the shadow, on both sides of it: what is lost whole nobody can fill."""
    mask = np.zeros(shade.shape, bool)
    mask[line[:, 0], line[:, 1]] = True
    ahead = ndimage.binary_dilation(mask, _EIGHT, iterations=2) & work.centre & ~shade
    return int(ndimage.label(ahead, _EIGHT)[1]) >= 2


def _wall_about(work: _Work, line: NDArray[np.bool_]) -> tuple[NDArray[np.bool_], NDArray[np.float64]]:
    """Cells of wall nearer to the lost than to the kept centre line, and the distance of all cells from the lost."""
    to_line = ndimage.distance_transform_edt(~line)
    kept = work.centre & ~line
    to_kept = ndimage.distance_transform_edt(~kept) if kept.any() else np.full(line.shape, np.inf)
    reach = float(work.thick[line].max()) + 1.5
    return (work.truth == OCCUPIED) & (to_line <= reach) & (to_line <= to_kept), to_line


def _mask(path: list[Cell], shape: tuple[int, ...]) -> NDArray[np.bool_]:
    mask = np.zeros(shape, bool)
    rows, cols = np.array(path).T
    mask[rows, cols] = True
    return mask
