"""A line with faults around a sound one: messages and times in, bytes out."""

from __future__ import annotations

from typing import Final

import numpy as np

from tools.emulator.faults.bytewise import Garble, doubled, dropped, flipped, misread
from tools.emulator.faults.calendar import Spell
from tools.emulator.line import Line

KINDS: Final = frozenset({"hangup", "stall", "half_frame", "garbage", "drop", "double", "flip", "baud"})
"""Faults that are the line's."""

_GARBLES: Final[dict[str, Garble]] = {"drop": dropped, "double": doubled, "flip": flipped}


class FaultyLine:
    """A `Line` that faults befall.

    ``send`` and ``take`` are the device's way to the host, ``hear`` the way back.  Noise is made as messages set out,
    so that it does not depend on how often the line is looked at.
    """

    def __init__(self, line: Line, seed: int) -> None:
        self._line = line
        self._rngs = {way: np.random.default_rng((seed, 0xBAD, number)) for number, way in enumerate(("out", "in"))}
        self._spells: list[Spell] = []
        self._halves = 0

    def begin(self, t_ns: int, spell: Spell) -> None:
        """Let a fault befall the line."""
        match spell.fault.kind:
            case "garbage":
                self._line.send(t_ns, self._rngs["out"].bytes(spell.fault.count))
            case "half_frame" if spell.to_ns <= spell.from_ns:
                self._halves += 1
            case _:
                self._spells.append(spell)

    def is_hung_up(self, t_ns: int) -> bool:
        """Whether the port is gone now."""
        return self._has("hangup", t_ns)

    def send(self, t_ns: int, data: bytes) -> None:
        """Put a message on the line."""
        if data and (self._halves or self._has("half_frame", t_ns)):
            self._halves = max(0, self._halves - 1)
            data = data[: len(data) // 2]
        self._line.send(t_ns, self._garbled(t_ns, data, "out"))

    def take(self, t_ns: int) -> bytes:
        """Return the bytes that have come to the host by ``t_ns`` and were not taken before."""
        if self._has("stall", t_ns):
            return b""
        data = self._line.take(t_ns)
        return b"" if self.is_hung_up(t_ns) else data

    def hear(self, t_ns: int, data: bytes) -> bytes:
        """Return what reaches the device of bytes that the host sent."""
        return b"" if self.is_hung_up(t_ns) else self._garbled(t_ns, data, "in")

    def collide(self, t_ns: int, data: bytes) -> bytes:
        """Let the host speak while the device may be speaking on the same wire (see `Line.collide`)."""
        return self._line.collide(t_ns, data)

    def clear(self) -> None:
        """Forget what has not left yet."""
        self._line.clear()

    def _garbled(self, t_ns: int, data: bytes, way: str) -> bytes:
        for spell in self._active(t_ns):
            fault = spell.fault
            if garble := _GARBLES.get(fault.kind):
                data = garble(data, fault.rate, self._rngs[way])
            elif fault.kind == "baud":
                said, heard = (fault.baud, self._line.baud) if way == "out" else (self._line.baud, fault.baud)
                data = misread(data, said, heard)
        return data

    def _has(self, kind: str, t_ns: int) -> bool:
        return any(spell.fault.kind == kind for spell in self._active(t_ns))

    def _active(self, t_ns: int) -> list[Spell]:
        if self._spells and any(spell.to_ns <= t_ns for spell in self._spells):
            self._spells = [spell for spell in self._spells if spell.to_ns > t_ns]
        return self._spells
