"""Beams on end that saw what the beam before them in the same direction saw: what a circle at rest is made of."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from mapping.rest import FROZEN
from mapping.turns import Beam

GRAIN_BEAMS = 64
"""Of those that agree, so many of the last are asked for their grain."""


@dataclass(frozen=True, slots=True)
class Pair:
    """A beam, the one that looked the same way before it, and the correlation of their grain (nan: nothing is told)."""

    now: Beam
    before: Beam
    grain: float


class Agreeing:
    """Pairs on end that agree, the oldest first."""

    def __init__(self) -> None:
        self._pairs: list[Pair] = []
        self._loose = 0

    def add(self, pair: Pair, within_rad: float) -> None:
        """Take the next pair; those at headings farther than ``within_rad`` from its own are forgotten."""
        self._loose = self._loose + 1 if pair.grain < FROZEN else 0
        self._pairs.append(pair)
        while abs(self._pairs[0].before.heading_rad - pair.now.heading_rad) > within_rad:
            del self._pairs[0]

    def clear(self) -> None:
        """Forget all pairs; how many were loose on end stays known."""
        self._pairs.clear()

    def end(self) -> None:
        """Forget all: a pair did not agree."""
        self._pairs.clear()
        self._loose = 0

    def forget_before(self, number: int) -> None:
        """Forget the pairs with a beam before this one."""
        self._pairs = [pair for pair in self._pairs if pair.before.number >= number]

    def at(self, share: float) -> Pair:
        """Give the pair at this share of the way from the first, 0, to the last, 1; there must be one."""
        return self._pairs[int(share * (len(self._pairs) - 1))]

    @property
    def span(self) -> tuple[int, int]:
        """Numbers of the first beam that is agreed with and of the last that agrees; there must be a pair."""
        return self._pairs[0].before.number, self._pairs[-1].now.number

    @property
    def turned_rad(self) -> float:
        """Angle over which beams agree."""
        return abs(self._pairs[-1].now.turn_rad - self._pairs[0].now.turn_rad) if self._pairs else 0.0

    @property
    def loose(self) -> int:
        """Pairs on end whose walls agree and whose grain does not."""
        return self._loose

    @property
    def grain(self) -> float:
        """Median correlation of the grain over the last pairs; 1 where nothing is told."""
        told = [pair.grain for pair in self._pairs[-GRAIN_BEAMS:] if not math.isnan(pair.grain)]
        return float(np.median(told)) if told else 1.0
