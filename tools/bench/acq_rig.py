"""An acquisition process on pseudo-terminals: what the benches of the acquisition are measured on."""

from __future__ import annotations

import contextlib
import json
import os
import pty
import select
import time
import tty
from collections import Counter
from pathlib import Path
from typing import Any, Final, Self

import zmq

from config.schema import Config, Feed, Recording, Sonar
from daemon.child import Child
from daemon.clock import Clock
from daemon.job import Job
from daemon.link import FATAL, READY
from daemon.wire import head
from drivers.log import read_log
from drivers.records import Chunk

SESSION: Final = "bench"
_PATIENCE_S: Final = 20.0
_TICKS: Final = os.sysconf("SC_CLK_TCK")


class Wire:
    """One serial line: our end of a pseudo-terminal, the other one under a name that outlives hang-ups."""

    def __init__(self, link: Path) -> None:
        self.link = link
        self.sent = bytearray()
        self._device = self._host = -1
        self.plug_in()

    def plug_in(self) -> None:
        """Make the line, or make it anew after a hang-up."""
        self._device, self._host = pty.openpty()
        tty.setraw(self._host)
        os.set_blocking(self._device, False)
        fresh = self.link.with_name(self.link.name + ".new")
        fresh.symlink_to(os.ttyname(self._host))
        fresh.replace(self.link)

    def hang_up(self) -> None:
        """Pull the plug: reading and writing fail at the other end, and the name is gone, as udev would have it."""
        self.link.unlink(missing_ok=True)
        for descriptor in (self._device, self._host):
            os.close(descriptor)
        self._device = self._host = -1

    def write(self, data: bytes, wait_s: float = 5.0) -> int:
        """Deliver ``data`` as fast as the other end takes it; return how many bytes it took."""
        done, end_s = 0, time.monotonic() + wait_s
        while done < len(data) and time.monotonic() < end_s:
            try:
                done += os.write(self._device, data[done : done + 1024])
            except BlockingIOError:
                select.select([], [self._device], [], 0.05)
        self.sent += data[:done]
        return done

    def read(self) -> bytes:
        """Return what the host has sent, perhaps nothing."""
        try:
            return os.read(self._device, 65536)
        except (BlockingIOError, OSError):
            return b""

    def close(self) -> None:
        """End the line."""
        if self._device >= 0:
            self.hang_up()


class Rig:
    """The acquisition process alone, without supervisor and map, with a line for the sonar and one for each feed."""

    def __init__(self, folder: Path, feeds: dict[str, int] | None = None, sonar: Sonar | None = None) -> None:
        """Make the lines: ``feeds`` is baud by name, ``sonar`` what is configured but for its port."""
        self.folder = folder
        self.logs = folder / "logs"
        names = ["sonar", *(feeds or {})]
        self.wires = {name: Wire(folder / name) for name in names}
        sonar = (sonar or Sonar()).model_copy(update={"port": str(folder / "sonar")})
        lines = tuple(Feed(name=name, port=str(folder / name), baud=baud) for name, baud in (feeds or {}).items())
        self.config = Config(sonar=sonar, feed=lines, recording=Recording(folder=str(self.logs), disk_low_mib=0.0))
        self.told: Counter[str] = Counter()
        self.events: list[tuple[float, str, dict[str, Any]]] = []
        self.health: dict[str, Any] = {}
        self.ready_s = 0.0
        self._context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
        self._link = self._context.socket(zmq.ROUTER)
        self._link.setsockopt(zmq.ROUTER_HANDOVER, 1)
        self._link.setsockopt(zmq.LINGER, 0)
        self._link.setsockopt(zmq.RCVHWM, 100_000)
        self._address = f"ipc://{folder}/link"
        self._link.bind(self._address)
        self._child = Child("acquire", "daemon.acquire")

    @property
    def pid(self) -> int:
        """Number of the running process."""
        return self._child.pid or 0

    @property
    def is_alive(self) -> bool:
        """Whether the process runs."""
        return self._child.pid is not None and Path(f"/proc/{self.pid}/stat").exists()

    def start(self) -> Rig:
        """Start the process and wait until it records; ``ready_s`` is how long that took."""
        begun_s = time.monotonic()
        is_first = self._child.starts == 0
        self._is_ready = False
        self._child.start(Job(self._address, SESSION, self.config, Clock(), is_first))
        while not self._is_ready:
            self.listen(0.02)
            if time.monotonic() - begun_s > _PATIENCE_S or self._child.poll() is not None:
                raise TimeoutError("the acquisition does not start; see its message above")
        self.ready_s = time.monotonic() - begun_s
        return self

    def listen(self, wait_s: float = 0.0) -> None:
        """Take what the process tells, waiting for it at most ``wait_s``."""
        end_s = time.monotonic() + wait_s
        while self._link.poll(max(0, int((end_s - time.monotonic()) * 1000))):
            _, kind, *frames = self._link.recv_multipart()
            if kind == READY:
                self._is_ready = True
            elif kind == FATAL:
                raise TimeoutError(json.loads(frames[0])["message"])
            elif len(frames) > 1:
                self._take(frames)

    def kill(self) -> None:
        """End the process as a power cut would."""
        self._child.kill()

    def stop(self) -> None:
        """Let the process end in order."""
        self._child.ask_to_stop()
        end_s = time.monotonic() + _PATIENCE_S
        while self._child.pid is not None and self._child.poll() is None and time.monotonic() < end_s:
            self.listen(0.02)
        self._child.kill()

    def received(self, port: str) -> bytes:
        """Return all that the log says to have come from ``port``."""
        records = read_log(self.logs)
        chunks = (record for record in records if isinstance(record, Chunk))
        return b"".join(each.data for each in chunks if each.port == port and each.direction == "rx")

    def cpu_s(self) -> float:
        """Return the processor time that the process has used."""
        fields = Path(f"/proc/{self.pid}/stat").read_text().rpartition(")")[2].split()
        return (int(fields[11]) + int(fields[12])) / _TICKS

    def memory_mib(self, key: str = "VmHWM") -> float:
        """Return the process's resident memory: the most it ever had, or with ``VmRSS`` what it has now."""
        lines = Path(f"/proc/{self.pid}/status").read_text().splitlines()
        return next(int(line.split()[1]) for line in lines if line.startswith(key)) / 1024

    def descriptors(self) -> int:
        """Return how many files the process has open."""
        return len(list(Path(f"/proc/{self.pid}/fd").iterdir()))

    def threads(self) -> int:
        """Return how many threads the process has."""
        return len(list(Path(f"/proc/{self.pid}/task").iterdir()))

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._child.kill()
        for wire in self.wires.values():
            with contextlib.suppress(OSError):
                wire.close()
        self._link.close()
        self._context.term()

    def _take(self, frames: list[bytes]) -> None:
        topic, header = head(frames)
        self.told[topic] += 1
        if topic == "health":
            self.health = header
        elif topic == "event":
            self.events.append((time.monotonic(), header["kind"], header["fields"]))
