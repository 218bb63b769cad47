"""The acquisition's process: ports, log, sonar.  ``python -m daemon.acquire`` is started by the supervisor.

It shares nothing with the map but the log, and imports none of its libraries: native code there may hold the
interpreter for longer than a kernel's serial buffer lasts.
"""

from __future__ import annotations

import contextlib
import os
import platform
import sys
import time
from dataclasses import asdict
from importlib.metadata import version
from typing import Any, Final

from pydantic import ValidationError

from config.checks import check_sonar
from config.errors import DataError, LacunaError, PortError
from config.schema import Sonar
from daemon import snapshots
from daemon.beams import Beams
from daemon.fault import fault
from daemon.job import Job
from daemon.line import Line
from daemon.link import ANSWER, READY, Link, take_job
from daemon.recorder import Recorder
from daemon.turning import turning
from drivers.decoders import SONAR_PORT
from drivers.log import LogWriter
from drivers.polls import Poller
from drivers.records import Json
from drivers.tritech.head import Head

_LOOK_S: Final = 0.02
_ROUND_S: Final = 0.02
"""Pause of each round: reading every few bytes as they come would cost several times the processor.

It is a fraction of a ping, and the kernel holds a third of a second of a line.
"""

_HEALTH_NS: Final = 1_000_000_000


class Acquisition:
    """Opens the ports, then the log; raises PortError or LogError before anything is recorded."""

    def __init__(self, job: Job, link: Link) -> None:
        self._job = job
        self._link = link
        self._clock = job.clock
        self._sonar = job.config.sonar
        self._head = Head(self._sonar)
        self._is_stopped = False
        self._beams = Beams(job.config)
        for name, surface_mbar in job.surfaces_mbar.items():
            self._beams.tare(name, surface_mbar)
        self._lines = _lines(job)
        self._pollers = {feed.name: Poller(feed) for feed in job.config.feed if feed.poll}
        self._told_ns = 0
        self._saving: list[int] = []
        self._apply(job.settings)
        try:
            self._open(must=job.is_first)
            self._recorder = self._start_log()
        except LacunaError:
            self._close_ports()
            raise

    def run(self) -> None:
        """Acquire until told to stop; then let the sonar rest, close the log, and return."""
        for line in self._lines.values():
            self._tell_port("port_opened" if line.is_open else "port_lost", line)
        while not self._link.is_stopping:
            for command in self._link.wait(_LOOK_S):
                self._obey(command)
            t_ns, _ = self._clock.now()
            for line in self._lines.values():
                self._serve(line, t_ns)
            self._wait_on_sonar(t_ns)
            for name, poller in self._pollers.items():
                self._send(self._lines[name], poller.tick(t_ns))
            self._recorder.tick(t_ns)
            self._tell_saved()
            self._tell_health(t_ns)
            time.sleep(_ROUND_S / self._clock.rate)
        self._stop()

    def _open(self, must: bool) -> None:
        for line in self._lines.values():
            try:
                line.open()
            except PortError:
                if must:
                    raise
                continue
            self._watch(line)

    def _start_log(self) -> Recorder:
        job = self._job
        unfinished = sorted(path.name for path in job.folder.glob("*.mcap.part"))
        writer = LogWriter(job.folder, job.session, job.config, _versions(), resume=not job.is_first)
        recorder = Recorder(writer, job.folder, job.config.recording.disk_low_mib, self._clock, self._link.say)
        started: dict[str, Json] = {"pid": os.getpid(), "resumed": not job.is_first, "unfinished_logs": [*unfinished]}
        recorder.event("started", started)
        return recorder

    def _serve(self, line: Line, t_ns: int) -> None:
        """Read what has come and record it, before anything else sees it; bring a lost port back."""
        if not line.is_open:
            if line.is_due(t_ns) and line.try_again(t_ns):
                self._came_back(line)
            return
        if self._link.ready and line.descriptor not in (None, *self._link.ready):
            return
        try:
            data = line.read(t_ns)
        except PortError as error:
            self._lose(line, error)
            return
        if data:
            chunk = self._recorder.chunk(line.name, "rx", data)
            for each in self._beams.push(chunk):
                self._link.say(each)
            if line.name == SONAR_PORT:
                self._send(line, self._head.hear(chunk.t_ns, self._beams.frames))

    def _wait_on_sonar(self, t_ns: int) -> None:
        """Let time pass for the sonar: frames that no longer come are given up, requests are due."""
        for each in self._beams.expire(*self._clock.now()):
            self._link.say(each)
        self._send(self._lines[SONAR_PORT], self._head.hear(t_ns, self._beams.frames))

    def _send(self, line: Line, data: bytes) -> None:
        """Record what goes to the sonar, or to a feed that is polled, then send it."""
        if not data or not line.is_open:
            return
        self._recorder.chunk(line.name, "tx", data)
        try:
            line.write(data)
        except PortError as error:
            self._lose(line, error)

    def _lose(self, line: Line, error: PortError) -> None:
        if line.descriptor is not None:
            self._link.forget(line.descriptor)
        line.drop(self._clock.now()[0])
        self._beams.interrupt(line.name)
        self._tell_port("port_lost", line, str(error))

    def _came_back(self, line: Line) -> None:
        self._watch(line)
        self._tell_port("port_opened", line)
        if line.name == SONAR_PORT:
            # Whatever hangs on the line now may have been without power: it is set up from the beginning.
            self._head = Head(self._sonar)
            self._heed_stop()

    def _watch(self, line: Line) -> None:
        if line.descriptor is not None:
            self._link.watch(line.descriptor)

    def _tell_port(self, kind: str, line: Line, why: str = "") -> None:
        fields: dict[str, Json] = {"port": line.name, "url": line.url}
        self._recorder.event(kind, fields | ({"message": why} if why else {}))

    def _obey(self, command: dict[str, Any]) -> None:
        """Do what the operator asked for; it is in the log, safe from a crash, before it is answered."""
        do, fields = command["do"], command["fields"]
        error: str | None = None
        if do == "sonar":
            error = self._set_sonar(fields)
        elif do == "tare":
            error = self._tare(fields)
        elif do == "save":
            self._recorder.start_sync()
            self._saving.append(command["token"])
            return
        else:
            self._recorder.event(do, fields)
        self._link.report(ANSWER, {"token": command["token"], "error": error or self._recorder.flush(), "fields": {}})

    def _tell_saved(self) -> None:
        """Answer who asked for it once the disk has what was recorded: nobody waits for it, least of all the lines."""
        if not self._saving or self._recorder.is_syncing:
            return
        health = self._recorder.health()
        for token in self._saving:
            self._link.report(ANSWER, {"token": token, "error": self._recorder.error, "fields": health})
        self._saving.clear()

    def _tare(self, fields: dict[str, Any]) -> str | None:
        """Record the pressure at the surface, then use it; return why that is not possible, or None."""
        try:
            tare = self._beams.tare_of(self._clock.now()[0], fields.get("port"), fields.get("surface_mbar"))
        except DataError as error:
            return str(error)
        self._recorder.event("tare", asdict(tare))
        self._beams.tare(tare.port, tare.surface_mbar)
        return None

    def _set_sonar(self, fields: dict[str, Any]) -> str | None:
        """Set the sonar and record it; return why that is not possible, or None."""
        try:
            self._apply(fields)
        except ValidationError as error:
            first = error.errors(include_url=False)[0]
            return f"the sonar cannot be set so: {'.'.join(map(str, first['loc']))}: {first['msg']}"
        except DataError as error:
            return f"the sonar cannot be set so: {error}"
        self._recorder.event("settings", fields)
        return None

    def _apply(self, fields: dict[str, Any]) -> None:
        """Set the sonar; raise ValidationError or DataError, with nothing changed, where it cannot be set so."""
        changed = {key: value for key, value in fields.items() if key not in ("start", "stop")}
        sonar = Sonar.model_validate(self._sonar.model_dump() | changed)
        for conflict in check_sonar(sonar):
            raise DataError(f"{conflict.key}: got {conflict.got}, expected {conflict.expected}")
        self._sonar = sonar
        if changed:
            self._head.change(self._sonar)
        if fields.get("start"):
            self._is_stopped = False
            self._head.start()
        self._is_stopped |= bool(fields.get("stop"))
        self._heed_stop()

    def _heed_stop(self) -> None:
        if self._is_stopped:
            self._head.stop()

    def _tell_health(self, t_ns: int) -> None:
        if t_ns - self._told_ns < _HEALTH_NS * self._clock.rate:
            return
        self._told_ns = t_ns
        beams = self._beams
        ports = {
            name: line.health(t_ns, beams.counters(name)) | beams.health(name, t_ns)
            for name, line in self._lines.items()
        }
        sonar: dict[str, Json] = {
            "state": self._head.state,
            "pings": self._beams.pings,
            **self._sonar.model_dump(mode="json", include={"range_m", "gain_pct", "step_deg", "sector_deg"}),
            **turning(self._head),
        }
        fields: dict[str, Json] = {"ports": {**ports}, "sonar": sonar, **self._recorder.health()}
        self._link.say(snapshots.health(*self._clock.now(), fields))

    def _stop(self) -> None:
        self._head.stop()  # it finishes the pings that it was asked for, and idles
        self._recorder.event("stopped", {"pid": os.getpid()})
        self._close_ports()
        self._recorder.close()

    def _close_ports(self) -> None:
        for line in self._lines.values():
            line.close()


def _lines(job: Job) -> dict[str, Line]:
    sonar = job.config.sonar
    lines = {SONAR_PORT: Line(SONAR_PORT, sonar.port, sonar.baud)}
    return lines | {feed.name: Line(feed.name, feed.port, feed.baud) for feed in job.config.feed}


def _versions() -> dict[str, str]:
    return {"lacuna": version("lacuna"), "python": platform.python_version()}


def main() -> int:
    """Acquire the session that standard input names."""
    job = take_job()
    link = Link(job.link, "acquire", wait_s=0.0, heeds_term=True)
    try:
        acquisition = Acquisition(job, link)
        link.report(READY, {})
        acquisition.run()
    except LacunaError as error:
        link.fatal(error)
        return error.exit_code
    except Exception as error:  # noqa: BLE001  (the last place that can tell it in a line)
        link.fatal(fault("acquisition", error))
        return LacunaError.exit_code
    finally:
        with contextlib.suppress(KeyboardInterrupt):
            link.close()
    return 0


if __name__ == "__main__":
    sys.exit(main())
