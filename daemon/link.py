"""A child's line to the supervisor: snapshots and reports up, commands down, on one socket."""

from __future__ import annotations

import json
import os
import signal
from types import FrameType
from typing import Any, Final

import zmq

from config.errors import LacunaError
from daemon.job import Job, read_job
from daemon.snapshots import Snapshot
from daemon.wire import encode
from drivers.records import Json

SAY: Final = b"say"
READY: Final = b"ready"
FATAL: Final = b"fatal"
ANSWER: Final = b"answer"
NOTE: Final = b"note"
DO: Final = b"do"

_QUEUE: Final = 2000
"""Messages that may wait for the supervisor: a minute of beams."""
_STDIN: Final = 0


def take_job() -> Job:
    """Read the job from standard input."""
    with os.fdopen(_STDIN, "rb", buffering=0, closefd=False) as lines:
        return read_job(lines.readline())


class Link:
    """The child called ``name`` at its end of the line.

    ``wait_s`` is how long a full line may hold it up.  With ``heeds_term`` SIGTERM ends it too; without, only the
    supervisor does, because a service manager signals all processes at once and the map must outlive the log.
    """

    def __init__(self, address: str, name: str, wait_s: float, heeds_term: bool) -> None:
        self._context: zmq.Context[zmq.Socket[bytes]] = zmq.Context(io_threads=1)
        self._socket = self._context.socket(zmq.DEALER)
        self._socket.setsockopt(zmq.IDENTITY, name.encode())
        self._socket.setsockopt(zmq.SNDHWM, _QUEUE)
        self._socket.setsockopt(zmq.SNDTIMEO, int(wait_s * 1000))
        self._socket.connect(address)
        self._poller = zmq.Poller()
        self._poller.register(self._socket, zmq.POLLIN)
        self._poller.register(_STDIN, zmq.POLLIN)
        self._stop = False
        self.ready: frozenset[int] = frozenset()
        """Watched files that had something to read when the last ``wait`` ended; none where it waited in vain."""
        signal.signal(signal.SIGTERM, self._on_signal if heeds_term else signal.SIG_IGN)
        signal.signal(signal.SIGINT, signal.SIG_IGN)

    @property
    def is_stopping(self) -> bool:
        """Whether the supervisor asked for the end, or is gone."""
        return self._stop

    def watch(self, descriptor: int) -> None:
        """Wake from ``wait`` when this file has something to read."""
        self._poller.register(descriptor, zmq.POLLIN)

    def forget(self, descriptor: int) -> None:
        """Watch a file no more."""
        if descriptor in self._poller:
            self._poller.unregister(descriptor)

    def wait(self, wait_s: float) -> list[dict[str, Any]]:
        """Sleep until something comes, at most ``wait_s``; return the supervisor's commands."""
        ready = dict(self._poller.poll(int(wait_s * 1000)))
        self.ready = frozenset(each for each in ready if isinstance(each, int))
        if _STDIN in ready and not os.read(_STDIN, 4096):
            self._stop = True
            self._poller.unregister(_STDIN)
        commands = []
        while self._socket in ready and self._socket.poll(0):
            kind, data = self._socket.recv_multipart()
            if kind == DO:
                commands.append(json.loads(data))
        return commands

    def say(self, snapshot: Snapshot) -> bool:
        """Publish ``snapshot``; say whether the line had room for it."""
        return self._send(SAY, *encode(snapshot, 0, ""))

    def report(self, kind: bytes, body: dict[str, Json]) -> bool:
        """Tell the supervisor itself something."""
        return self._send(kind, json.dumps(body).encode())

    def fatal(self, error: LacunaError) -> None:
        """Tell the supervisor why this child ends, for the operator."""
        self.report(FATAL, {"exit_code": error.exit_code, "message": str(error)})

    def close(self) -> None:
        """Let what was said leave, and close."""
        self._socket.close(linger=1000)
        self._context.term()

    def _send(self, *frames: bytes) -> bool:
        try:
            self._socket.send_multipart(frames)
        except zmq.Again:
            return False
        return True

    def _on_signal(self, _number: int, _frame: FrameType | None) -> None:
        self._stop = True
