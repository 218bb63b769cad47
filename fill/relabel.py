"""Finding the walls of a mask again: only those that a change touches are looked at anew.

Walls are told apart by tokens.  A wall that changed keeps the token of the one that it has most cells in common with,
so that a cell's token changes only where walls parted, met, came or went.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Hashable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from fill.recent import Recent
from fill.scene import SPECK
from fill.segments import EIGHT, MOST_TIPS, End, Walls, find_walls

Slices = tuple[slice, slice]
Tokens = NDArray[np.int32]


@dataclass(frozen=True, slots=True)
class Wall:
    """One connected wall: its box, its ends as the grid has them, and whether it is a speck."""

    box: Slices
    ends: tuple[End, ...]
    speck: bool


@dataclass(frozen=True, slots=True)
class Found:
    """Walls of ``mask`` ``(rows, cols)``: ``part`` has the token of each cell's wall, 0 for none.

    ``walls`` are the same as layers, with all their ends, and ``each`` one by one, by their tokens.
    """

    mask: NDArray[np.bool_]
    part: Tokens
    walls: Walls
    each: dict[int, Wall]


class Finder:
    """Finds walls; an end that was there in this pass or the last is the same object again."""

    def __init__(self) -> None:
        self._ends = Recent()
        self._last_token = 0

    def begin(self) -> None:
        """Begin a pass."""
        self._ends.begin()

    def find(self, mask: NDArray[np.bool_], before: Found | None) -> Found:
        """Find the walls of ``mask`` ``(rows, cols)``, from those of another of the same shape where there is one."""
        if before is not None and len(before.walls.tips) <= MOST_TIPS:
            found = self._find(mask, before)
            if len(found.walls.tips) <= MOST_TIPS:
                return found
        # With more, which walls are noise hangs on all the others.
        return self._find(mask, _nothing(mask.shape))

    def _find(self, mask: NDArray[np.bool_], before: Found) -> Found:
        changed = np.flatnonzero(mask != before.mask)
        if not len(changed):
            return before
        touched, window = _touched(changed, before)
        old = before.part[window]
        kept = np.where(np.isin(old, sorted(touched)), 0, old)
        fresh = mask[window] & (kept == 0)
        label = np.zeros(fresh.shape, np.int32)
        count = int(ndimage.label(fresh, EIGHT, output=label))
        tokens = self._tokens(label, count, old, touched)
        walls = find_walls(fresh, (window[0].start, window[1].start))
        part = before.part.copy()
        part[window] = np.where(fresh, tokens[label], kept)
        each = {token: wall for token, wall in before.each.items() if token not in touched}
        each |= self._each(label, tokens, walls, window)
        ends = sorted((end for wall in each.values() for end in wall.ends), key=_tip)
        layers = _laid(before.walls, walls, part, window, kept == 0)
        return Found(mask.copy(), part, dataclasses.replace(layers, ends=tuple(ends)), each)

    def _tokens(self, label: Tokens, count: int, old: Tokens, touched: set[int]) -> Tokens:
        """Return for each label the token that most of its cells had and no other has now, or a new one."""
        tokens = np.arange(count + 1, dtype=np.int32) + self._last_token
        tokens[0] = 0
        self._last_token += count
        both = (label > 0) & (old > 0)
        pairs, cells = np.unique(np.stack([label[both], old[both]], axis=1), axis=0, return_counts=True)
        free, named = set(touched), set[int]()
        for number, token in pairs[np.lexsort((pairs[:, 1], pairs[:, 0], -cells))].tolist():
            if token in free and number not in named:
                free.discard(token)
                named.add(number)
                tokens[number] = token
        return tokens

    def _each(self, label: Tokens, tokens: Tokens, walls: Walls, window: Slices) -> dict[int, Wall]:
        ends: dict[int, list[End]] = {}
        for end in walls.ends:
            col, row = end.line[0].astype(np.int64).tolist()
            number = int(label[row - window[0].start, col - window[1].start])
            ends.setdefault(number, []).append(self._end(end, int(tokens[number])))
        specks = (np.bincount(label.ravel()) <= SPECK).tolist()
        return {
            int(tokens[number]): Wall(_shifted(box, window), tuple(ends.get(number, ())), specks[number])
            for number, box in enumerate(ndimage.find_objects(label), 1)
        }

    def _end(self, end: End, token: int) -> End:
        key: Hashable = (
            token, end.x, end.y, end.dx, end.dy, end.half, end.length, end.wander, end.line.tobytes(),
        )  # fmt: skip
        return self._ends.recall(key, lambda: dataclasses.replace(end, wall=token))


def _nothing(shape: tuple[int, ...]) -> Found:
    none = np.zeros(shape, np.int32)
    bare = none.astype(bool)
    tips = np.zeros((0, 2), np.int64)
    return Found(bare, none, Walls(bare, none, none.astype(np.float32), bare, (), tips, np.zeros(0, bool)), {})


def _touched(changed: NDArray[np.int64], before: Found) -> tuple[set[int], Slices]:
    """Tokens of walls in or next to cells that changed, and a window about them, one cell wider."""
    shape = before.part.shape
    rows, cols = np.divmod(changed, shape[1])
    around = np.arange(-1, 2)
    near = np.clip(rows[:, None, None] + around[:, None], 0, shape[0] - 1)
    beside = np.clip(cols[:, None, None] + around, 0, shape[1] - 1)
    touched = set(np.unique(before.part[near, beside]).tolist()) - {0}
    boxes = [before.each[token].box for token in touched]
    low = [min([int(at.min()), *(box[axis].start for box in boxes)]) for axis, at in enumerate((rows, cols))]
    high = [max([int(at.max()) + 1, *(box[axis].stop for box in boxes)]) for axis, at in enumerate((rows, cols))]
    first, last = (slice(max(a - 1, 0), min(b + 1, size)) for a, b, size in zip(low, high, shape, strict=True))
    return touched, (first, last)


def _shifted(box: tuple[slice, ...], window: Slices) -> Slices:
    rows, cols = (slice(at.start + to.start, at.stop + to.start) for at, to in zip(box, window, strict=True))
    return rows, cols


def _laid(before: Walls, fresh: Walls, part: Tokens, window: Slices, anew: NDArray[np.bool_]) -> Walls:
    """Lay what was found in a window into the layers of before, where it was looked at ``anew``."""
    mask, half, centre = before.mask.copy(), before.half.copy(), before.centre.copy()
    for layer, found in ((mask, fresh.mask), (half, fresh.half), (centre, fresh.centre)):
        np.copyto(layer[window], found, where=anew)
    label = before.label.copy()
    np.copyto(label[window], np.where(fresh.mask, part[window], 0), where=anew)
    corner = window[0].start, window[1].start
    rows, cols = before.tips.T
    there = (rows >= corner[0]) & (rows < window[0].stop) & (cols >= corner[1]) & (cols < window[1].stop)
    there[there] = anew[rows[there] - corner[0], cols[there] - corner[1]]
    tips = np.concatenate([before.tips[~there], fresh.tips + corner])
    return Walls(mask, label, half, centre, (), tips, np.concatenate([before.noise[~there], fresh.noise]))


def _tip(end: End) -> tuple[float, float]:
    """Row and column of an end's last cell: ends come in that order."""
    return float(end.line[0, 1]), float(end.line[0, 0])
