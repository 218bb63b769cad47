"""What was worked out before, and still holds: filling again costs what changed.

A result is remembered with the box of cells that it was made from.  It holds as long as no cell in the box changed, and
no wall that reaches into the box changed anywhere: walls are told apart by a token for all that they are, and a cell's
token is part of it.  So a remembered result is the one that would be made anew, and a fill from memory is the same to
the byte as one from scratch (a test holds this over many changes).

Closing goes in rounds, each with the fills of those before it among its walls.  A round's results are looked up in the
same round of the last pass, and in the round before of this one.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass, field
from typing import Final, TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from fill.scene import FARTHEST, from_water
from fill.segments import EIGHT, End, Walls, find_walls
from mapping.values import FREE

T = TypeVar("T")
Box = tuple[int, int, int, int]
"""First row and column, and the row and column behind the last."""

_TILE: Final = 8  # cells: changes are noted by tiles of so many
_MANY: Final = 1500  # walls: a grid in more pieces than this is noise, and looked at as one
_WHOLE: Final = 1


@dataclass(frozen=True, slots=True)
class _Wall:
    """One connected wall as it was found: its token, the layers of its box, and its ends."""

    token: int
    rows: slice
    cols: slice
    walls: Walls
    ends: tuple[End, ...]


@dataclass(slots=True)
class _Round:
    """What was known in one round: the layers that results were made from, and the results."""

    state: NDArray[np.uint8]
    mask: NDArray[np.bool_]
    walls: Walls
    found: dict[int, _Wall]
    results: dict[Hashable, tuple[Box, object]] = field(default_factory=dict)


def content(end: End) -> tuple[Hashable, ...]:
    """Return all that an end is, as a key."""
    return end.x, end.y, end.dx, end.dy, end.half, end.length, end.wander, end.wall, end.line.tobytes()


class Recent:
    """Results by all that they were made from; those that two passes running did not ask for are forgotten."""

    def __init__(self) -> None:
        self._old: dict[Hashable, object] = {}
        self._new: dict[Hashable, object] = {}

    def begin(self) -> None:
        """Begin a pass."""
        self._old, self._new = self._new, {}

    def recall(self, key: Hashable, make: Callable[[], T]) -> T:
        """Return what ``make`` would, which needs nothing but ``key``."""
        if key not in self._new:
            self._new[key] = self._old[key] if key in self._old else make()
        return self._new[key]  # type: ignore[return-value]


class Memory:
    """Remembers one grid's last filling; a grid of another shape starts afresh."""

    def __init__(self) -> None:
        self._last: list[_Round] = []
        self._now: list[_Round] = []
        self._known: dict[Hashable, _Wall] = {}
        self._used: dict[Hashable, _Wall] = {}
        self._tokens = _WHOLE
        self._state = np.zeros((0, 0), np.uint8)
        self._clean: list[Callable[[Box], bool]] = []
        self._before: list[_Round] = []
        self._free: NDArray[np.bool_] | None = None
        self._water = np.zeros((0, 0))
        self._watered: _Round | None = None

    @property
    def measured(self) -> Walls:
        """Walls of the first round of this pass: as measured, without fills."""
        return self._now[0].walls

    def begin(self) -> None:
        """Begin a pass: what the last one did not use is forgotten."""
        self._last, self._now = self._now, []
        if self._used:
            self._known, self._used = self._used, {}

    def walls(self, mask: NDArray[np.bool_], state: NDArray[np.uint8]) -> Walls:
        """Begin a round: find the walls in ``mask`` ``(rows, cols)``, labelled by their tokens, with all their ends."""
        index = len(self._now)
        if not index:
            self._state = state.copy()  # the caller may go on to draw in it
        before = [rounds[at] for rounds, at in ((self._last, index), (self._now, index - 1)) if 0 <= at < len(rounds)]
        before = [each for each in before if each.mask.shape == mask.shape]
        same = next((each for each in before if np.array_equal(each.mask, mask)), None)
        if same is not None:
            walls, found = same.walls, same.found
            self._used |= {key: each for key, each in self._known.items() if each.token in found}
        else:
            found = self._found(mask)
            walls = _assembled(mask, found, before[0] if before else None)
        here = _Round(self._state, mask.copy(), walls, found)
        self._clean = [_cleanness(here, each) for each in before]
        self._before = before
        self._now.append(here)
        return walls

    def water(self, state: NDArray[np.uint8]) -> NDArray[np.float64]:
        """Return how far every cell is from water, worked out again about the cells where that changed.

        One pass is of one ``state``.
        """
        if self._now and self._watered is self._now[0]:
            return self._water
        free = state == FREE
        if self._free is None or self._free.shape != free.shape:
            self._water = from_water(state)
        elif len(changed := np.argwhere(free != self._free)):
            reach = int(FARTHEST) + 1
            low, high = changed.min(axis=0), changed.max(axis=0) + 1
            outer = tuple(slice(max(a - 2 * reach, 0), b + 2 * reach) for a, b in zip(low, high, strict=True))
            inner = tuple(slice(max(a - reach, 0), b + reach) for a, b in zip(low, high, strict=True))
            part = tuple(slice(i.start - o.start, i.stop - o.start) for i, o in zip(inner, outer, strict=True))
            self._water = self._water.copy()
            self._water[inner] = from_water(state[outer])[part]
        self._free = free
        self._watered = self._now[0] if self._now else None
        return self._water

    def recall(self, key: Hashable, make: Callable[[], tuple[Box, T]]) -> T:
        """Return what ``make`` would, which tells the box of cells that it looked at; what else it needs is ``key``."""
        return self.recall_all([key], lambda _: [make()])[0]

    def recall_all(self, keys: Sequence[Hashable], make: Callable[[list[int]], list[tuple[Box, T]]]) -> list[T]:
        """Return for each key what ``make`` would, which is given the places among ``keys`` of those not known."""
        if not self._now:
            return [made for _, made in make(list(range(len(keys))))]
        results = self._now[-1].results
        fresh = {}
        for place, key in enumerate(keys):
            if key not in results and key not in fresh:
                known = self._known_before(key)
                if known is None:
                    fresh[key] = place
                else:
                    results[key] = known
        results.update(zip(fresh, make(list(fresh.values())) if fresh else (), strict=True))
        return [results[key][1] for key in keys]  # type: ignore[misc]

    def _known_before(self, key: Hashable) -> tuple[Box, object] | None:
        """Return an earlier round's result that still holds."""
        for before, clean in zip(self._before, self._clean, strict=True):
            known = before.results.get(key)
            if known is not None and clean(known[0]):
                return known
        return None

    def _found(self, mask: NDArray[np.bool_]) -> dict[int, _Wall]:
        label = np.zeros(mask.shape, np.int32)
        if not mask.size:
            return {}
        if ndimage.label(mask, EIGHT, output=label) > _MANY:
            label = mask.astype(np.int32)
        boxes = ndimage.find_objects(label)
        found = (self._wall(label, number, (box[0], box[1]), mask.shape) for number, box in enumerate(boxes, 1))
        return {each.token: each for each in found}

    def _wall(self, label: NDArray[np.int32], number: int, box: tuple[slice, slice], shape: tuple[int, ...]) -> _Wall:
        rows, cols = (slice(max(s.start - 1, 0), min(s.stop + 1, size)) for s, size in zip(box, shape, strict=True))
        own = label[rows, cols] == number
        key = rows.start, cols.start, own.shape, own.tobytes()
        known = self._used.get(key) or self._known.get(key)
        if known is None:
            walls = find_walls(own)
            self._tokens += 1
            known = _Wall(
                self._tokens, rows, cols, walls, tuple(_moved(e, rows, cols, self._tokens) for e in walls.ends)
            )
        self._used[key] = known
        return known


def _moved(end: End, rows: slice, cols: slice, token: int) -> End:
    """Return an end as the grid has it."""
    return dataclasses.replace(
        end, x=end.x + cols.start, y=end.y + rows.start, line=end.line + np.array([cols.start, rows.start]), wall=token
    )


def _assembled(mask: NDArray[np.bool_], found: dict[int, _Wall], before: _Round | None) -> Walls:
    """Lay walls out in one grid, on the layers of an earlier round where there is one."""
    if before is None:
        flat = np.zeros(mask.shape, bool)
        walls = Walls(flat, np.zeros(mask.shape, np.int32), np.zeros(mask.shape, np.float32), flat.copy(), ())
        gone, fresh = [], list(found.values())
    else:
        kept = before.walls
        walls = Walls(kept.mask.copy(), kept.label.copy(), kept.half.copy(), kept.centre.copy(), ())
        gone = [each for token, each in before.found.items() if token not in found]
        fresh = [each for token, each in found.items() if token not in before.found]
    for each in gone:
        box = each.rows, each.cols
        own = walls.label[box] == each.token
        walls.mask[box][own] = walls.centre[box][own] = False
        walls.label[box][own] = 0
        walls.half[box][own] = 0.0
    for each in fresh:
        box, own = (each.rows, each.cols), each.walls.mask
        walls.mask[box][own] = True
        walls.label[box][own] = each.token
        walls.half[box][own] = each.walls.half[own]
        walls.centre[box][own] = each.walls.centre[own]
    ends = sorted((end for each in found.values() for end in each.ends), key=_tip)
    return dataclasses.replace(walls, ends=tuple(ends))


def _tip(end: End) -> tuple[float, float]:
    """Row and column of an end's last cell: ends come in that order."""
    return float(end.line[0, 1]), float(end.line[0, 0])


def _always(_: Box) -> bool:
    return True


def _cleanness(now: _Round, before: _Round) -> Callable[[Box], bool]:
    """Return what tells whether nothing in a box changed from one round to the other."""
    changed = (now.walls.label != before.walls.label) | (now.state != before.state)
    rows, cols = np.nonzero(changed)
    if not len(rows):
        return _always
    shape = tuple(size // _TILE + 1 for size in changed.shape)
    tiles = np.zeros((shape[0] + 1, shape[1] + 1), np.int64)
    tiles[rows // _TILE + 1, cols // _TILE + 1] = 1
    total = tiles.cumsum(axis=0).cumsum(axis=1).tolist()

    def clean(box: Box) -> bool:
        first, left = max(box[0], 0) // _TILE, max(box[1], 0) // _TILE
        last, right = min(box[2] // _TILE + 1, shape[0]), min(box[3] // _TILE + 1, shape[1])
        if last <= first or right <= left:
            return True
        return bool(total[last][right] - total[first][right] - total[last][left] + total[first][left] == 0)

    return clean
