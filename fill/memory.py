"""What was worked out before, and still holds: filling again costs what changed.

A result is remembered with what it was made from: a box of cells, the walls in it, and a box in which it asked how far
water is.  It holds as long as nothing of that changed; walls count as changed where a cell's token did (``relabel``).
So a remembered result is the one that would be made anew, and a fill from memory is the same to the byte as one from
scratch (a test holds this over many changes).

Closing goes in rounds, each with the fills of those before it among its walls.  A round's results are looked up in the
same round of the last pass, and in the round before of this one.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass, field
from itertools import compress, islice
from typing import Final, Literal, TypeVar

import numpy as np
from numpy.typing import NDArray

from fill.recent import Recent
from fill.relabel import Finder, Found
from fill.scene import FARTHEST, from_water
from fill.segments import Walls
from mapping.values import FREE

T = TypeVar("T")
Box = tuple[int, int, int, int]
"""First row and column, and the row and column behind the last."""
Layer = Literal["walls", "state", "water"]

_NOWHERE: Final = (0, 0, 0, 0)
_TILE: Final = 8  # cells: changes are noted by tiles of so many; as many as bytes in a number of 64 bits


@dataclass(frozen=True, slots=True)
class Basis:
    """What a result was made from.

    ``seen`` is the box of cells whose state it asked for, and their walls if ``walls``; ``wet`` that of cells which it
    asked how far water is.
    """

    seen: Box
    wet: Box | None = None
    walls: bool = True


Result = tuple[Basis, object]


@dataclass(slots=True)
class _Round:
    """What was known in one round: the layers that results were made from, and the results."""

    state: NDArray[np.uint8]
    water: NDArray[np.float64]
    found: Found
    results: dict[Hashable, Result] = field(default_factory=dict)
    boxes: list[NDArray[np.int64]] = field(default_factory=list)

    def bases(self) -> NDArray[np.int64]:
        """Return ``(n, 9)`` what each result was made from: the boxes seen and wet, and whether walls count."""
        known = sum(map(len, self.boxes))
        fresh = [basis for basis, _ in islice(self.results.values(), known, None)]
        rows = [(*basis.seen, *(basis.wet or _NOWHERE), basis.walls) for basis in fresh]
        self.boxes = [np.concatenate([*self.boxes, np.array(rows, np.int64).reshape(-1, 9)])]
        return self.boxes[0]


class Memory:
    """Remembers one grid's last filling; a grid of another shape starts afresh."""

    def __init__(self) -> None:
        self._last: list[_Round] = []
        self._now: list[_Round] = []
        self._finder = Finder()
        self._recent = Recent()
        self._before: list[_Earlier] = []

    @property
    def measured(self) -> Walls:
        """Walls of the first round of this pass: as measured, without fills."""
        return self._now[0].found.walls

    def begin(self) -> None:
        """Begin a pass: what the last one did not use is forgotten."""
        self._last, self._now = self._now, []
        self._finder.begin()
        self._recent.begin()

    def walls(self, mask: NDArray[np.bool_], state: NDArray[np.uint8]) -> Walls:
        """Begin a round: find the walls in ``mask`` ``(rows, cols)``, labelled by their tokens, with all their ends.

        One pass is of one ``state``.
        """
        index = len(self._now)
        before = [rounds[at] for rounds, at in ((self._last, index), (self._now, index - 1)) if 0 <= at < len(rounds)]
        before = [each for each in before if each.found.mask.shape == mask.shape]
        same = next((each.found for each in before if np.array_equal(each.found.mask, mask)), None)
        found = same or self._finder.find(mask, before[0].found if before else None)
        if index:
            here = _Round(self._now[0].state, self._now[0].water, found)
        else:  # the caller may go on to draw in its state
            here = _Round(state.copy(), _water(state, before[0] if before else None), found)
        self._before = [_Earlier(here, each) for each in before]
        self._now.append(here)
        return found.walls

    def water(self, state: NDArray[np.uint8]) -> NDArray[np.float64]:
        """Return how far every cell is from water, in this pass."""
        return self._now[0].water if self._now else from_water(state)

    def recall(self, key: Hashable, make: Callable[[], tuple[Basis, T]]) -> T:
        """Return what ``make`` would, which tells what it was made from; what else it needs is ``key``."""
        if not self._now:
            return make()[1]
        results = self._now[-1].results
        known = results.get(key) or self._known_before(key) or make()
        results[key] = known
        return known[1]  # type: ignore[return-value]

    def recall_all(self, keys: Sequence[Hashable], make: Callable[[list[int]], list[tuple[Basis, T]]]) -> list[T]:
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

    def recent(self, key: Hashable, make: Callable[[], T]) -> T:
        """Return what ``make`` would, which needs nothing but ``key``."""
        return self._recent.recall(key, make)

    def _known_before(self, key: Hashable) -> Result | None:
        """Return an earlier round's result that still holds."""
        for before in self._before:
            known = before.holding().get(key)
            if known is not None:
                return known
        return None


class _Earlier:
    """An earlier round, beside the present one."""

    def __init__(self, now: _Round, was: _Round) -> None:
        self._now, self._was = now, was
        self._holding: dict[Hashable, Result] | None = None

    def holding(self) -> dict[Hashable, Result]:
        """Return those of its results of whose bases nothing changed."""
        if self._holding is None:
            bases = self._was.bases()
            seen, wet, walls = bases[:, :4], bases[:, 4:8], bases[:, 8] > 0
            clean = np.where(walls, self._clean("walls", seen), self._clean("state", seen)) & self._clean("water", wet)
            self._holding = dict(compress(self._was.results.items(), clean.tolist()))
        return self._holding

    def _clean(self, layer: Layer, boxes: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Tell for boxes ``(n, 4)`` whether nothing changed in them."""
        changed = self._changed(layer)
        if not changed.any():
            return np.ones(len(boxes), np.bool_)
        total = _table(changed)
        most = np.array(total.shape) - 1
        first = np.minimum(np.maximum(boxes[:, :2], 0) // _TILE, most)
        last = np.maximum(np.minimum((boxes[:, 2:] - 1) // _TILE + 1, most), first)
        (top, left), (bottom, right) = first.T, last.T
        return np.asarray(total[bottom, right] - total[top, right] - total[bottom, left] + total[top, left] == 0)

    def _changed(self, layer: Layer) -> NDArray[np.bool_]:
        if layer == "water":
            return np.asarray(self._now.water != self._was.water, np.bool_)
        state = np.asarray(self._now.state != self._was.state, np.bool_)
        if layer == "state" or self._now.found is self._was.found:
            return state
        now, was = self._now.found, self._was.found
        grew = [token for token, wall in now.each.items() if token in was.each and wall.speck != was.each[token].speck]
        walls = (now.walls.label != was.walls.label) | (now.walls.half != was.walls.half)
        return np.asarray(state | walls | (np.isin(now.walls.label, grew) if grew else False), np.bool_)


def _table(changed: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Sum up the changed tiles above and left of each."""
    high, wide = (-(-size // _TILE) for size in changed.shape)
    whole = np.zeros((high * _TILE, wide * _TILE), bool)
    whole[: changed.shape[0], : changed.shape[1]] = changed
    tiles = np.zeros((high + 1, wide + 1), np.int64)
    tiles[1:, 1:] = whole.view(np.uint64).reshape(high, _TILE, wide).any(axis=1)  # a row of a tile is one number
    return tiles.cumsum(axis=0).cumsum(axis=1)


def _water(state: NDArray[np.uint8], before: _Round | None) -> NDArray[np.float64]:
    """How far every cell is from water, worked out again about the cells where that changed."""
    if before is None:
        return from_water(state)
    changed = np.flatnonzero((state == FREE) != (before.state == FREE))
    if not len(changed):
        return before.water
    cells = np.divmod(changed, state.shape[1])
    reach = int(FARTHEST) + 1
    inner, outer = (
        tuple(slice(max(int(each.min()) - far, 0), int(each.max()) + 1 + far) for each in cells)
        for far in (reach, 2 * reach)
    )
    part = tuple(slice(i.start - o.start, i.stop - o.start) for i, o in zip(inner, outer, strict=True))
    water = before.water.copy()
    water[inner] = from_water(state[outer])[part]
    return water
