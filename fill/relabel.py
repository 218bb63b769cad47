"""Finding the walls of a mask again: only those that a change touches are looked at anew.

Walls are told apart by tokens.  A wall that changed keeps the token of the one that it has most cells in common with,
so that a cell's token changes only where walls parted, met, came or went.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from fill.recent import Recent
from fill.scene import SPECK
from fill.segments import EIGHT, End, Walls, find_walls

Slices = tuple[slice, slice]
_MANY: Final = 1500  # walls: a grid in more pieces than this is noise, and looked at as one


@dataclass(frozen=True, slots=True)
class Wall:
    """One connected wall: its token, its box, what was found in that, and its ends as the grid has them."""

    token: int
    box: Slices
    walls: Walls
    ends: tuple[End, ...]
    speck: bool


@dataclass(frozen=True, slots=True)
class Found:
    """Walls of ``mask`` ``(rows, cols)``: ``part`` has the token of each cell's wall, 0 for none.

    ``walls`` are the same as layers, with all their ends, and ``each`` one by one; ``whole``: there were too many to
    tell them apart.
    """

    mask: NDArray[np.bool_]
    part: NDArray[np.int32]
    walls: Walls
    each: dict[int, Wall]
    whole: bool


class Finder:
    """Finds walls, and remembers single ones over two passes."""

    def __init__(self) -> None:
        self._known = Recent()
        self._last_token = 0

    def begin(self) -> None:
        """Begin a pass."""
        self._known.begin()

    def find(self, mask: NDArray[np.bool_], before: Found | None) -> Found:
        """Find the walls of ``mask`` ``(rows, cols)``, from those of another of the same shape where there is one."""
        if before is None or before.whole:
            return self._afresh(mask)
        changed = np.flatnonzero(mask != before.mask)
        rows, cols = np.divmod(changed, mask.shape[1])
        touched = _touched(rows, cols, before.part)
        window = _window(rows, cols, [before.each[token].box for token in touched])
        first = window[0].start, window[1].start
        part = np.where(np.isin(before.part[window], touched), 0, before.part[window])
        label, count = ndimage.label(mask[window] & (part == 0), EIGHT)
        if len(before.each) - len(touched) + count > _MANY:
            return self._afresh(mask)
        free = set(touched)
        fresh = []
        for number, box in enumerate(ndimage.find_objects(label), 1):
            own = label[box] == number
            token = self._token(before.part[window][box][own], free)
            part[box][own] = token
            fresh.append(self._wall(own, _shifted(box, first), token, mask.shape))
        everywhere = before.part.copy()
        everywhere[window] = part
        kept = {token: wall for token, wall in before.each.items() if token not in touched}
        gone = [before.each[token] for token in touched]
        each = kept | {wall.token: wall for wall in fresh}
        return Found(mask.copy(), everywhere, _laid(before.walls, gone, fresh, each.values()), each, False)

    def _afresh(self, mask: NDArray[np.bool_]) -> Found:
        label = np.zeros(mask.shape, np.int32)
        count = int(ndimage.label(mask, EIGHT, output=label)) if mask.size else 0
        if count > _MANY:
            label = mask.astype(np.int32)
        fresh = []
        part = np.zeros(mask.shape, np.int32)
        for number, box in enumerate(ndimage.find_objects(label) if count else (), 1):
            own = label[box] == number
            token = self._token(np.zeros(0, np.int32), set())
            part[box][own] = token
            fresh.append(self._wall(own, _shifted(box, (0, 0)), token, mask.shape))
        flat = np.zeros(mask.shape, bool)
        bare = Walls(flat, np.zeros(mask.shape, np.int32), np.zeros(mask.shape, np.float32), flat, ())
        return Found(
            mask.copy(), part, _laid(bare, [], fresh, fresh), {wall.token: wall for wall in fresh}, count > _MANY
        )

    def _token(self, had: NDArray[np.int32], free: set[int]) -> int:
        """Return the token that most of these cells had, of those that are free still, or a new one."""
        tokens, counts = np.unique(had, return_counts=True)
        for token in tokens[np.argsort(-counts, kind="stable")].tolist():
            if token in free:
                free.discard(token)
                return int(token)
        self._last_token += 1
        return self._last_token

    def _wall(self, own: NDArray[np.bool_], box: Slices, token: int, shape: tuple[int, ...]) -> Wall:
        """Return the wall of a box, with one cell more about it where the grid goes on."""
        wider = [slice(max(at.start - 1, 0), min(at.stop + 1, size)) for at, size in zip(box, shape, strict=True)]
        margins = [(at.start - w.start, w.stop - at.stop) for at, w in zip(box, wider, strict=True)]
        padded = np.pad(own, margins)
        rows, cols = wider
        walls = self._known.recall((padded.shape, padded.tobytes()), lambda: find_walls(padded))
        key = rows.start, cols.start, token, id(walls)

        def made() -> tuple[Walls, Wall]:
            ends = tuple(_moved(end, rows, cols, token) for end in walls.ends)
            return walls, Wall(token, (rows, cols), walls, ends, int(own.sum()) <= SPECK)

        return self._known.recall(key, made)[1]


def _touched(rows: NDArray[np.int64], cols: NDArray[np.int64], part: NDArray[np.int32]) -> list[int]:
    """Tokens of walls in or next to the cells that changed."""
    around = np.arange(-1, 2)
    near = np.clip(rows[:, None, None] + around[:, None], 0, part.shape[0] - 1)
    beside = np.clip(cols[:, None, None] + around, 0, part.shape[1] - 1)
    return [token for token in np.unique(part[near, beside]).tolist() if token > 0]


def _window(rows: NDArray[np.int64], cols: NDArray[np.int64], boxes: list[Slices]) -> Slices:
    """Return the least window about cells and boxes."""
    low = [min([int(at.min()), *(box[axis].start for box in boxes)]) for axis, at in enumerate((rows, cols))]
    high = [max([int(at.max()) + 1, *(box[axis].stop for box in boxes)]) for axis, at in enumerate((rows, cols))]
    return slice(low[0], high[0]), slice(low[1], high[1])


def _shifted(box: tuple[slice, ...], first: tuple[int, int]) -> Slices:
    rows, cols = (slice(at.start + to, at.stop + to) for at, to in zip(box, first, strict=True))
    return rows, cols


def _moved(end: End, rows: slice, cols: slice, token: int) -> End:
    """Return an end as the grid has it."""
    return dataclasses.replace(
        end, x=end.x + cols.start, y=end.y + rows.start, line=end.line + np.array([cols.start, rows.start]), wall=token
    )


def _laid(before: Walls, gone: list[Wall], fresh: list[Wall], each: Iterable[Wall]) -> Walls:
    """Take walls out of layers, and lay others in; ends come in order of row and column."""
    walls = Walls(before.mask.copy(), before.label.copy(), before.half.copy(), before.centre.copy(), ())
    for wall in gone:
        own = wall.walls.mask
        walls.mask[wall.box][own] = walls.centre[wall.box][own] = False
        walls.label[wall.box][own] = 0
        walls.half[wall.box][own] = 0.0
    for wall in fresh:
        own = wall.walls.mask
        walls.mask[wall.box][own] = True
        walls.label[wall.box][own] = wall.token
        walls.half[wall.box][own] = wall.walls.half[own]
        walls.centre[wall.box][own] = wall.walls.centre[own]
    ends = sorted((end for wall in each for end in wall.ends), key=_tip)
    return dataclasses.replace(walls, ends=tuple(ends))


def _tip(end: End) -> tuple[float, float]:
    """Row and column of an end's last cell: ends come in that order."""
    return float(end.line[0, 1]), float(end.line[0, 0])
