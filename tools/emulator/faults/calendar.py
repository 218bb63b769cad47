"""When faults come: from a script and a seed, whatever the pace of asking."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from heapq import heapify, heappop, heappush
from itertools import count

import numpy as np

from tools.emulator.faults.script import Fault

SECOND_NS = 1_000_000_000
NEVER_NS = 1 << 62


@dataclass(frozen=True, slots=True)
class Spell:
    """One time that a fault comes; ``to_ns`` is `NEVER_NS` where it stays."""

    fault: Fault
    from_ns: int
    to_ns: int


class Calendar:
    """The spells of a script, in order of time; the same seed gives the same ones."""

    def __init__(self, faults: tuple[Fault, ...], seed: int) -> None:
        self._faults = faults
        self._seed = seed
        self._coming: list[tuple[int, int, Spell, Iterator[Spell]]] | None = None
        self._utc_step_ns = 0

    @property
    def utc_step_ns(self) -> int:
        """What all the steps of the clock that have come add to UTC."""
        return self._utc_step_ns

    def start(self, t_ns: int) -> None:
        """Count from now; nothing comes before, and later calls change nothing."""
        if self._coming is not None:
            return
        self._coming = []
        for number, fault in enumerate(self._faults):
            spells = _spells(fault, t_ns, np.random.default_rng((self._seed, 0xFA117, number)))
            first = next(spells)
            self._coming.append((first.from_ns, number, first, spells))
        heapify(self._coming)

    def advance(self, t_ns: int) -> list[Spell]:
        """Return the spells that have begun by ``t_ns`` since the last call."""
        begun = []
        while self._coming and self._coming[0][0] <= t_ns:
            _, number, spell, spells = heappop(self._coming)
            begun.append(spell)
            if spell.fault.kind == "clock_step":
                self._utc_step_ns += int(spell.fault.step_s * SECOND_NS)
            for after in spells:
                heappush(self._coming, (after.from_ns, number, after, spells))
                break
        return begun


def _spells(fault: Fault, origin_ns: int, rng: np.random.Generator) -> Iterator[Spell]:
    lasts_ns = int(min(fault.lasts_s * SECOND_NS, NEVER_NS))
    from_ns = origin_ns
    for _ in count():
        wait_s = fault.at_s if fault.every_s is None else float(rng.exponential(fault.every_s))
        from_ns += int((wait_s or 0.0) * SECOND_NS)
        to_ns = min(from_ns + lasts_ns, NEVER_NS)
        yield Spell(fault, from_ns, to_ns)
        from_ns = to_ns
        if fault.every_s is None or to_ns >= NEVER_NS:
            return
