"""Faults on the lines of a running acquisition: it must outlive them, and each line alone pays for its own."""

from __future__ import annotations

import random
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from config.schema import Sonar
from drivers.readings import Ping
from drivers.tritech.decoder import TritechDecoder
from tools.bench.acq_rig import Rig, Wire
from tools.bench.figure import Figure, at_least, at_most
from tools.bench.load import pings, sentences

BACK_S: Final = 2.0
FAULTS: Final = ("hang-up", "stall", "garbage", "half frame", "dropped", "doubled", "flipped")
FEEDS: Final = {"calm": 4800, "compass": 4800, "depth": 4800, "altitude": 4800}
_CALM: Final = "calm"
_WAIT_S: Final = 6.0
_HEARD_S: Final = 0.1
"""Time to read what was said before the next fault: a hang-up takes with it what nobody has read."""

_LONG: Final = 0.04
"""Share of the hang-ups and stalls that last for seconds."""


@dataclass(slots=True)
class Faulty:
    """A line with its talker, its next fault, and what became of those before."""

    name: str
    wire: Wire
    talk: Iterator[bytes]
    generator: random.Random
    cycles: int = 0
    is_out: bool = False
    until_s: float = 0.0
    returned_s: float | None = None
    back_s: list[float] = field(default_factory=list)
    whole: list[bytes] = field(default_factory=list)

    def turn(self, now_s: float) -> None:
        """Do what is due: end an outage, or commit the next fault."""
        if now_s < self.until_s or self.returned_s is not None:
            return
        if self.is_out:
            self.wire.plug_in()
            self.is_out, self.returned_s = False, now_s
            return
        self.cycles += 1
        self._commit(self.generator.choice(FAULTS), now_s)

    def came_back(self, at_s: float) -> None:
        """Note that the port was opened again, if that was waited for."""
        if self.returned_s is not None:
            self.back_s.append(at_s - self.returned_s)
            self.returned_s = None
            self._speak()
            self.until_s = time.monotonic() + _HEARD_S

    def _commit(self, fault: str, now_s: float) -> None:
        lasting_s = self.generator.uniform(2.0, 4.0) if self.generator.random() < _LONG else 0.0
        frame = next(self.talk)
        at = self.generator.randrange(1, len(frame) - 1)
        match fault:
            case "hang-up":
                self.wire.write(frame[:at])
                self.wire.hang_up()
                self.is_out = True
                self.until_s = now_s + (lasting_s or self.generator.uniform(0.01, 0.3))
                return
            case "stall":
                self.until_s = now_s + (lasting_s or 0.3)
            case "garbage":
                self.wire.write(self.generator.randbytes(self.generator.choice((1, 40, 3000))))
            case "half frame":
                self.wire.write(frame[:at])
            case "dropped":
                self.wire.write(frame[: at - 1] + frame[at:])
            case "doubled":
                self.wire.write(frame[:at] + frame[at - 1 :])
            case _:
                self.wire.write(frame[:at] + bytes((frame[at] ^ 0x10,)) + frame[at + 1 :])
        self.until_s = max(self.until_s, now_s + _HEARD_S)
        self._speak()

    def _speak(self) -> None:
        """Say something sound after the fault."""
        for _ in range(2):
            frame = next(self.talk)
            self.wire.write(frame)
            self.whole.append(frame)


def measure(folder: Path, cycles: int) -> Iterator[Figure]:
    """Commit ``cycles`` faults on all lines but one, which talks on; see `Figure`."""
    with Rig(folder, FEEDS, Sonar(bins=100)) as rig:
        rig.start()
        lines = _lines(rig)
        calm, calm_talk = rig.wires[_CALM], sentences(99)
        rig.listen(1.5)
        descriptors, threads, heard = rig.descriptors(), rig.threads(), len(rig.events)
        while sum(line.cycles for line in lines) < cycles or any(line.is_out or line.returned_s for line in lines):
            now_s = time.monotonic()
            for line in lines:
                if line.returned_s is not None and now_s - line.returned_s > _WAIT_S:
                    line.came_back(now_s)  # in vain: the time it took breaks the promise
                elif line.is_out or sum(each.cycles for each in lines) < cycles:
                    line.turn(now_s)
            calm.write(next(calm_talk))
            rig.listen(0.01)
            heard = _hear(rig, heard, {line.name: line for line in lines})
        rig.listen(1.0)
        yield Figure("faults survived", float(sum(line.cycles for line in lines)), "", "no crash", rig.is_alive)
        yield at_most("descriptors leaked", rig.descriptors() - descriptors, 0, "")
        yield at_most("threads leaked", rig.threads() - threads, 0, "")
        rig.stop()
        yield from _judge(rig, lines)


def _lines(rig: Rig) -> list[Faulty]:
    talks = {name: sentences(number) for number, name in enumerate(FEEDS)} | {"sonar": pings(5, bins=100)}
    return [
        Faulty(name, rig.wires[name], talk, random.Random(name))  # noqa: S311  (no secret)
        for name, talk in talks.items()
        if name != _CALM
    ]


def _hear(rig: Rig, heard: int, lines: dict[str, Faulty]) -> int:
    """Tell the lines which ports were opened since; return how many events are heard by now."""
    for at_s, kind, fields in rig.events[heard:]:
        if kind == "port_opened" and fields["port"] in lines:
            lines[fields["port"]].came_back(at_s)
    return len(rig.events)


def _judge(rig: Rig, lines: list[Faulty]) -> Iterator[Figure]:
    back_s = [each for line in lines for each in line.back_s]
    yield at_most(f"longest way back of {len(back_s)} hang-ups", max(back_s, default=0.0), BACK_S, "s")
    calm = rig.wires[_CALM]
    lost = len(calm.sent) - len(rig.received(_CALM))
    yield at_most("bytes lost on the undisturbed line", abs(lost), 0, "")
    others = [kind for _, kind, fields in rig.events if kind == "port_lost" and fields["port"] == _CALM]
    yield at_most("losses of the undisturbed line", len(others), 0, "")
    decoder = TritechDecoder(rig.config.sonar)
    readings = [*decoder.push(0, rig.received("sonar")), *decoder.finish()]
    read = {each.echoes.tobytes() for each in readings if isinstance(each, Ping)}
    (sonar,) = [line for line in lines if line.name == "sonar"]
    share = sum(frame[44:-1] in read for frame in sonar.whole) / max(len(sonar.whole), 1)
    yield at_least("sound pings read after a fault", share, 1.0, "")
