"""How far along a passage the vehicle was at each moment of a way, by the grain of the walls.

Progress and speed are states of a hidden Markov model: what beams hear under way is held against what was heard at the
first rest and, were it so far on, at the second.  Every distance within reach is followed at once.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mapping.grain import Grain
from mapping.path import ACCELERATION_M_S2, END_SPEED_M_S, HERE, KNOT_S, REST_M, THERE, Floats, Ints
from mapping.pattern import CELL_M, Images, Pattern

EVERY = 2
"""A distance is tried every so many cells of progress."""
SLACK_M = 0.4
"""How far beyond either end the vehicle may be meanwhile."""
FASTEST_M_S, BACK_M_S = 0.8, 0.1
POWER = 0.25
"""Power of one level: neighbours share their speckle."""
NEVER = 1e-30


@dataclass(frozen=True, slots=True)
class Passage:
    """The line of a passage from a rest on: along ``axis`` ``(2,)``, to its left by ``slope`` and ``bend``."""

    axis: Floats
    slope: float
    bend: float

    def at(self, far_m: Floats) -> Floats:
        """Places ``(..., 2)`` so far along it."""
        beside = far_m * (self.slope + self.bend * far_m)
        left = np.array([-self.axis[1], self.axis[0]])
        return np.asarray(far_m[..., None] * self.axis + beside[..., None] * left, dtype=np.float64)

    @property
    def back(self) -> Passage:
        """The same line the other way."""
        return Passage(-self.axis, self.slope, -self.bend)


@dataclass(frozen=True, slots=True)
class Speeds:
    """Speeds ``(v,)`` in cells a step, how likely one follows another ``(v, v)``, and how likely each is at rest."""

    cells: Ints
    turns: Floats
    still: Floats

    def moved(self, state: Floats, beyond: float) -> Floats:
        """Move states ``(v, ..., places)`` on by a step, each at its speed."""
        return np.stack([_on(each, cells, beyond) for each, cells in zip(state, self.cells, strict=True)])


class Progress:
    """A way along a passage, held against distances ``far_m`` ``(d,)``: ``height`` ``(d,)`` is their log-evidence."""

    def __init__(self, grain: Grain, passage: Passage, reach_m: float, knots: int, seconds: float) -> None:
        self.passage = passage
        self.far_m = np.arange(0.0, reach_m, EVERY * CELL_M)
        self._where_m = np.arange(-SLACK_M, reach_m + SLACK_M, CELL_M)
        self._steps = max(4, round(seconds / KNOT_S))
        self._speeds = _speeds(seconds / self._steps)
        here, there = (Pattern(grain, group) for group in (HERE, THERE))
        self._odds = POWER * self._heard(grain, here, there, knots)
        at_rest = grain.marks.group == THERE
        place = passage.at(self.far_m)[:, None, :] + grain.marks.arm_m[at_rest]
        level = grain.level[at_rest].astype(np.float32)
        rests = here.odds(level, place[..., 0].astype(np.float32), place[..., 1].astype(np.float32)).sum(axis=1)
        self.height = self._evidence() + POWER * rests

    def _heard(self, grain: Grain, here: Pattern, there: Pattern, knots: int) -> Images:
        """Sum log-likelihood ratios over marks of half a step: ``(2 steps, distances, places)``."""
        way = np.flatnonzero(grain.marks.group > HERE)
        moment = (grain.marks.state[way] - 1 + grain.marks.share[way]) / (knots - 1)
        part = np.clip(moment * 2 * self._steps, 0, 2 * self._steps - 1).astype(np.intp)
        way, part = way[np.argsort(part, kind="stable")], np.sort(part)
        arm = grain.marks.arm_m[way].astype(np.float32)
        level = grain.level[way].astype(np.float32)
        line = self.passage.at(self._where_m).astype(np.float32)
        left = line - self.passage.at(self.far_m).astype(np.float32)[:, None, :]
        x, y = (arm[:, k, None] + line[:, k] for k in (0, 1))
        odds = here.odds(level[:, None], x, y)[:, None, :]
        x, y = (arm[:, k, None, None] + left[..., k] for k in (0, 1))
        odds = odds + there.odds(level[:, None, None], x, y)
        total = np.zeros((2 * self._steps, *odds.shape[1:]), dtype=np.float32)
        first = np.flatnonzero(np.diff(part, prepend=-1))
        if len(first):
            total[part[first]] = np.add.reduceat(odds, first, axis=0)
        return total

    def _evidence(self) -> Floats:
        """Go forward through all states: log-evidence of each distance."""
        speeds = self._speeds
        start = np.exp(-0.5 * (self._where_m / REST_M) ** 2)
        state = np.broadcast_to(speeds.still[:, None, None] * start, (len(speeds.cells), *self._odds.shape[1:]))
        height = np.zeros(len(self.far_m))
        for early, late in self._odds.reshape(self._steps, 2, *self._odds.shape[1:]):
            top = early.max(axis=1) + late.max(axis=1)
            told = [np.exp(each - each.max(axis=1, keepdims=True)) for each in (early, late)]
            state = (speeds.turns.T @ state.reshape(len(speeds.cells), -1)).reshape(state.shape)
            state = speeds.moved(state * np.stack([_met(told, cells, np.multiply) for cells in speeds.cells]), 0.0)
            peak = np.maximum(state.max(axis=(0, 2)), NEVER)
            height += top + np.log(peak)
            state = state / peak[:, None]
        end = np.exp(-0.5 * ((self._where_m - self.far_m[:, None]) / REST_M) ** 2)
        return np.asarray(height + np.log(np.maximum(np.einsum("vds,ds,v->d", state, end, speeds.still), NEVER)))

    def best(self, which: int) -> Floats:
        """Progress in m at the ends of all steps ``(steps + 1,)`` that fits a distance best."""
        speeds, odds = self._speeds, self._odds[:, which].astype(np.float64)
        turns, still = np.log(np.maximum(speeds.turns, NEVER)), np.log(np.maximum(speeds.still, NEVER))
        state = still[:, None] - 0.5 * (self._where_m / REST_M) ** 2
        before = []
        for early, late in odds.reshape(self._steps, 2, -1):
            choice = state[:, None, :] + turns[:, :, None]
            before.append(choice.argmax(axis=0))
            best = choice.max(axis=0)
            met = np.stack([_met([early, late], cells, np.add) for cells in speeds.cells])
            state = speeds.moved(best + met, -np.inf)
        state = state + still[:, None] - 0.5 * ((self._where_m - self.far_m[which]) / REST_M) ** 2
        speed, at = divmod(int(state.argmax()), state.shape[1])
        progress = [at]
        for choice in before[::-1]:
            at = min(max(at - int(speeds.cells[speed]), 0), len(self._where_m) - 1)
            speed = int(choice[speed, at])
            progress.append(at)
        return self._where_m[progress[::-1]]


def _speeds(step_s: float) -> Speeds:
    """Speeds from ``-BACK_M_S`` to ``FASTEST_M_S``, a cell a step apart."""
    cells = np.arange(-round(BACK_M_S * step_s / CELL_M), round(FASTEST_M_S * step_s / CELL_M) + 1)
    spread = ACCELERATION_M_S2 * step_s**2 * (KNOT_S / step_s) ** 0.5 / CELL_M
    turns = np.exp(-0.5 * ((cells[:, None] - cells) / spread) ** 2)
    still = np.exp(-0.5 * (cells * CELL_M / (END_SPEED_M_S * step_s)) ** 2)
    return Speeds(cells, turns / turns.sum(axis=1, keepdims=True), still)


def _met(halves: Sequence[NDArray[np.floating]], cells: int, join: np.ufunc) -> NDArray[np.floating]:
    """Join what both halves of a step tell, from where each begins that goes on by so many cells."""
    early, late = (_on(half, -round(share * cells)) for half, share in zip(halves, (0.25, 0.75), strict=True))
    return np.asarray(join(early, late))


def _on(values: NDArray[np.floating], cells: int, beyond: float = 0.0) -> NDArray[np.floating]:
    """Move values along their last axis."""
    if cells == 0:
        return values
    moved = np.full_like(values, beyond)
    if cells > 0:
        moved[..., cells:] = values[..., :-cells]
    else:
        moved[..., :cells] = values[..., -cells:]
    return moved
