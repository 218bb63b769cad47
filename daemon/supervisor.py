"""The supervisor: two children that do the work, the sockets that others reach, and an orderly end.

A third child, where a crash left logs unfinished, makes them whole and ends.

Nothing is recorded before both sockets are bound and all ports are open.  From then on a child that dies is started
again: the acquisition goes on in the session's next segment, the map reads the log from its beginning.
"""

from __future__ import annotations

import json
import shutil
import signal
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from types import FrameType
from typing import Any, Final

import zmq

from config import errors
from config.errors import LacunaError
from config.schema import Config
from daemon.broker import Broker
from daemon.child import Child
from daemon.clock import Clock, started
from daemon.desk import Desk
from daemon.job import Job
from daemon.link import ANSWER, FATAL, NOTE, READY, SAY
from daemon.status import Status
from daemon.wire import head
from drivers.records import Json

_LOOK_S: Final = 0.05
_STOP_S: Final = 2.0
"""How long the acquisition may take to let the sonar rest and close the log."""

Say = Callable[[str], None]


@dataclass(frozen=True, slots=True)
class Outcome:
    """How a run ended: ``map`` is the last that the map's process told of itself (lag, stations, digests)."""

    session: str
    folder: Path
    map: dict[str, Any] = field(default_factory=dict)


class Supervisor:
    """One run of the daemon.  ``say`` is given a line for the operator now and then.

    ``rate`` stamps an emulated dive in emulated time.  ``map_wait_s`` is how long the map may take to read the log to
    its end when everything stops; what it has not read then is nevertheless in the log.
    """

    def __init__(self, config: Config, say: Say, rate: float = 1.0, map_wait_s: float = 2.0) -> None:
        self._config = config
        self._say = say
        self._map_wait_s = map_wait_s
        self._clock: Clock = started(rate)
        self.session = f"{datetime.now(UTC):%Y%m%dT%H%M%SZ}-{config.site.name}"
        self._acquire = Child("acquire", "daemon.acquire")
        self._map = Child("map", "daemon.follow")
        self._salvage = Child("salvage", "daemon.salvage")
        self._status = Status(self.session, config)
        self._signals = 0
        self._is_ready = False
        self._fatal: LacunaError | None = None
        self._surfaces_mbar: dict[str, float] = {}
        self._settings: dict[str, Json] = {}

    def run(self) -> Outcome:
        """Run until SIGINT or SIGTERM.

        Raises ConfigError or PortError where an address or a port cannot be had, LogError where nothing can be
        recorded; a second signal ends everything at once.
        """
        folder = Path(tempfile.mkdtemp(prefix="lacuna-"))
        self._address = f"ipc://{folder}/link"
        context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
        self._link = context.socket(zmq.ROUTER)
        try:
            self._link.setsockopt(zmq.ROUTER_HANDOVER, 1)
            self._link.setsockopt(zmq.LINGER, 0)
            self._link.bind(self._address)
            with _signals(self._on_signal), Broker(self._config.publish, self.session) as broker:
                self._broker, self._desk = broker, Desk(broker, self._link, self._status)
                broker.ask = self._desk.take
                broker.listen(self._link, self._hear)
                self._work()
        finally:
            for child in (self._acquire, self._map, self._salvage):
                child.kill()
            self._link.close()
            context.term()
            shutil.rmtree(folder, ignore_errors=True)
        if self._fatal is not None:
            raise self._fatal
        return Outcome(self.session, Path(self._config.recording.folder), self._status.map)

    def _work(self) -> None:
        self._acquire.start(self._job(is_first=True))
        while not self._signals and self._fatal is None:
            self._turn()
            self._mind(self._acquire)
            if self._is_ready:
                self._mind(self._map)
                self._mend()
        self._stop()

    def _turn(self) -> None:
        self._broker.turn(_LOOK_S)
        self._desk.tick()
        if self._status.is_due():
            children = {child.name: (child.pid, child.starts) for child in (self._acquire, self._map)}
            self._broker.publish(self._status.frames(self._clock.now(), children, self._broker.values.numbers))

    def _mind(self, child: Child) -> None:
        """Start what has not run or has died; before the first recording the acquisition's end is ours."""
        code = child.poll()
        if code is not None and not self._is_ready:
            self._hear()
            self._fatal = self._fatal or LacunaError(f"the acquisition ended with code {code}; see its message above")
        elif code is not None:
            self._say(f"{child.name} ended with code {code}; starting it again")
        elif child.is_due() or (child.pid is None and child.starts == 0):
            child.start(self._job(is_first=False))

    def _mend(self) -> None:
        """Have earlier logs made whole, once, if there are any."""
        if self._salvage.starts:
            self._salvage.poll()
        elif self._map.starts and self._has_unfinished():
            self._salvage.start(self._job(is_first=True))

    def _has_unfinished(self) -> bool:
        parts = Path(self._config.recording.folder).glob("*.mcap.part")
        return any(not part.name.startswith(f"{self.session}-") for part in parts)

    def _job(self, is_first: bool) -> Job:
        carried = dict(self._surfaces_mbar), dict(self._settings)
        return Job(self._address, self.session, self._config, self._clock, is_first, *carried)

    def _hear(self) -> None:
        """Take what the children said."""
        while self._link.poll(0):
            name, kind, *frames = self._link.recv_multipart()
            if kind == SAY:
                self._pass_on(frames)
            elif kind == ANSWER:
                self._desk.hand_back(json.loads(frames[0]))
            elif kind == NOTE:
                text = json.loads(frames[0])["text"]
                self._say(text)
                self._desk.note(text)
            elif kind == READY and name == b"acquire" and not self._is_ready:
                self._is_ready = True
                self._say(f"recording session {self.session} in {self._config.recording.folder}")
            elif kind == FATAL:
                self._take_fatal(name.decode(), json.loads(frames[0]))

    def _pass_on(self, frames: list[bytes]) -> None:
        topic, header = head(frames)
        if topic == "health":
            self._status.take(header)
            return
        if topic == "event":
            self._say_event(header)
        self._broker.publish(frames)

    def _say_event(self, header: dict[str, Any]) -> None:
        kind, fields = header["kind"], header["fields"]
        if kind == "tare":
            self._surfaces_mbar[fields["port"]] = fields["surface_mbar"]
        if kind == "settings":
            # Of start and stop the newest counts.
            kept = {name: value for name, value in self._settings.items() if name not in ("start", "stop")}
            self._settings = (kept if {"start", "stop"} & set(fields) else self._settings) | fields
        if kind in ("port_lost", "disk") or (kind == "port_opened" and self._status.has_lost(fields["port"])):
            self._say(" ".join([kind, *(f"{key}={value}" for key, value in fields.items())]))

    def _take_fatal(self, name: str, body: dict[str, Any]) -> None:
        if not self._is_ready or self._signals:
            self._fatal = _error(body["exit_code"], body["message"])
        else:
            self._say(f"{name}: {body['message']}")

    def _stop(self) -> None:
        """Let the acquisition close the log, then the map read it to its end."""
        self._end(self._acquire, _STOP_S)
        self._end(self._map, self._map_wait_s)
        children = {child.name: (child.pid, child.starts) for child in (self._acquire, self._map)}
        self._broker.publish(self._status.frames(self._clock.now(), children, self._broker.values.numbers))

    def _end(self, child: Child, wait_s: float) -> None:
        child.ask_to_stop()
        end_s = time.monotonic() + wait_s
        while child.pid is not None and child.poll() is None:
            if time.monotonic() > end_s or self._signals > 1:
                self._say(f"{child.name} did not end in time; what is recorded is in the log")
                child.kill()
            self._turn()
        self._hear()

    def _on_signal(self, _number: int, _frame: FrameType | None) -> None:
        self._signals += 1


@contextmanager
def _signals(act: Callable[[int, FrameType | None], None]) -> Iterator[None]:
    before = {number: signal.signal(number, act) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield
    finally:
        for number, old in before.items():
            signal.signal(number, old)


def _error(exit_code: int, message: str) -> LacunaError:
    kinds = (errors.PortError, errors.LogError, errors.ConfigError, errors.DataError)
    return next((kind for kind in kinds if kind.exit_code == exit_code), LacunaError)(message)
