"""What a faulty compass and depth sensor take to be the truth."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from math import radians, tau
from typing import Final

from tools.emulator.echoes import Place
from tools.emulator.faults.calendar import Spell

KINDS: Final = frozenset({"stale", "jump"})
"""Faults that are the sensors'."""


class Senses:
    """Tells where the vehicle is, truly or as faults have it."""

    def __init__(self, where: Callable[[int], Place]) -> None:
        self._where = where
        self._spells: list[Spell] = []

    def begin(self, spell: Spell) -> None:
        """Let a fault befall the sensors."""
        self._spells.append(spell)

    def is_stuck(self, t_ns: int) -> bool:
        """Whether the sensors only repeat themselves."""
        return any(spell.fault.kind == "stale" and t_ns < spell.to_ns for spell in self._spells)

    def place_at(self, t_ns: int) -> Place:
        """Return the place that the sensors feel."""
        self._spells = [spell for spell in self._spells if t_ns < spell.to_ns]
        place = self._where(t_ns)
        for spell in self._spells:
            if spell.fault.kind == "jump":
                heading_rad = (place.heading_rad + radians(spell.fault.heading_deg)) % tau
                place = replace(place, heading_rad=heading_rad, depth_m=place.depth_m + spell.fault.depth_m)
        return place
