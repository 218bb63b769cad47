"""An emulated dive on two pseudo-terminals, in a clock that may run faster than the real one."""

from __future__ import annotations

import select
import sys
import time
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path
from subprocess import PIPE, Popen
from typing import Final

from drivers.records import Json
from tools.emulator.dive import Dive, DiveOptions
from tools.emulator.faults.bytewise import misread
from tools.emulator.faults.script import Port
from tools.emulator.ptys import FolderLock, PtyPort
from tools.emulator.site import SITES
from tools.emulator.truth import told, truth_of

SECOND_NS: Final = 1_000_000_000
SPEEDS: Final = (0.1, 50.0)
"""Least and greatest speed of the emulated clock beside the real one."""

_PIECE_NS: Final = 5_000_000
"""Emulated time between looks at the lines: some 60 bytes at 115200 baud."""
_SHORTEST_WAIT_S: Final = 0.001
_LONGEST_STEP_NS: Final = 100_000_000

Tell = Callable[[dict[str, Json]], None]


@dataclass(frozen=True, slots=True)
class _Clock:
    """Emulated time against real time.

    On a computer that is too busy, emulated time falls behind instead of jumping: no ping is cut short by it.
    """

    speed: float
    real_ns: int
    t_ns: int = 0

    def at(self, real_ns: int) -> _Clock:
        step = min(int((real_ns - self.real_ns) * self.speed), _LONGEST_STEP_NS)
        return replace(self, real_ns=real_ns, t_ns=self.t_ns + step)


class Emulation:
    """Serves a dive: ``<folder>/sonar`` is the head, ``<folder>/feed`` compass and depth.

    Lines, pings, vehicle and sensors all run ``speed`` times as fast as real ones.  A host that sets its side to
    another rate than the device's hears what receivers make of that.  ``tell`` gets what happens: ``ready`` with the
    ports, ``station`` at each rest, ``done`` after the last one, where the vehicle stays, and
    ``fault`` when something goes wrong by the dive's script.
    """

    def __init__(
        self,
        folder: Path,
        site: str = "keyhole",
        seed: int = 1,
        speed: float = 1.0,
        options: DiveOptions | None = None,
        tell: Tell | None = None,
    ) -> None:
        """Open the ports; raises InputError or PortError where the folder does not allow it."""
        self.dive = Dive(SITES[site](), seed, options)
        self._speed = speed
        self._wait_s = max(_PIECE_NS / speed / SECOND_NS, _SHORTEST_WAIT_S)
        self._tell = tell or (lambda _: None)
        self._lock = FolderLock(folder)
        with ExitStack() as undo:
            undo.callback(self._lock.release)
            self.sonar = PtyPort(folder / "sonar", self.dive.options.head.baud)
            undo.callback(self.sonar.unplug)
            self.feed = PtyPort(folder / "feed", self.dive.options.feed.baud)
            undo.pop_all()
        self._ports: dict[Port, PtyPort] = {"sonar": self.sonar, "feed": self.feed}
        self._told_spells = 0

    def truth(self) -> dict[str, Json]:
        """Return where everything truly is and was (see ``truth_of``)."""
        return truth_of(self.dive)

    def serve(self, stop: Callable[[], bool]) -> None:
        """Serve until ``stop()``; it is asked every few milliseconds."""
        self._tell({"event": "ready", "sonar": str(self.sonar.link), "feed": str(self.feed.link)})
        clock = _Clock(self._speed, time.monotonic_ns())
        while not stop():
            select.select([port for port in self._ports.values() if port.is_there], [], [], self._wait_s)
            clock = clock.at(time.monotonic_ns())
            self._round(clock)

    def close(self) -> None:
        """Close the ports, remove their names and let the folder go."""
        self.sonar.unplug()
        self.feed.unplug()
        self._lock.release()

    def _round(self, clock: _Clock) -> None:
        bauds = {"sonar": self.dive.options.head.baud, "feed": self.dive.options.feed.baud}
        if asked := self.sonar.read():
            self.dive.push(clock.t_ns, misread(asked, self.sonar.host_baud, bauds["sonar"]))
        self.feed.read()  # nothing listens at the sensors' end
        from_sonar, from_feed = self.dive.tick(clock.t_ns)
        self._hang_up(clock.t_ns)
        self.sonar.write(clock.real_ns, misread(from_sonar, bauds["sonar"], self.sonar.host_baud))
        self.feed.write(clock.real_ns, misread(from_feed, bauds["feed"], self.feed.host_baud))
        if self.dive.advance(clock.t_ns):
            self._report(clock.t_ns)

    def _hang_up(self, t_ns: int) -> None:
        for name, port in self._ports.items():
            if self.dive.is_hung_up(name, t_ns):
                port.unplug()
            else:
                port.plug_in()
        for spell in self.dive.spells[self._told_spells :]:
            self._told_spells += 1
            self._tell({"event": "fault", "t_s": round(t_ns / SECOND_NS, 3), **told(spell)})

    def _report(self, t_ns: int) -> None:
        t_s = round(t_ns / SECOND_NS, 3)
        if self.dive.done:
            self._tell({"event": "done", "t_s": t_s})
        else:
            total = len(self.dive.site.stops)
            self._tell({"event": "station", "station": self.dive.vehicle.index, "of": total, "t_s": t_s})


def spawn(
    folder: Path, site: str, seed: int, speed: float, stations: int | None, truth: Path | None, *more: str
) -> Popen[str]:
    """Start an emulation as a process of its own; its standard output has the events as JSON lines.

    ``more`` are further words of `lacuna emulate`, as ``--faults FILE``.  The first line, ``ready``, comes when the
    ports are open.  End it with ``terminate()``.
    """
    words = [sys.executable, "-m", "tools.cli", "emulate", "--json", "--folder", str(folder), "--site", site]
    words += ["--seed", str(seed), "--speed", str(speed)]
    words += [] if stations is None else ["--stations", str(stations)]
    words += [] if truth is None else ["--truth", str(truth)]
    words += more
    return Popen(words, stdout=PIPE, text=True)  # noqa: S603 - our own program with our own words
