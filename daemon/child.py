"""A child process that is started again when it dies."""

from __future__ import annotations

import contextlib
import subprocess
import sys
import time
from typing import Final

from daemon.job import Job

_FIRST_WAIT_S: Final = 0.2
_LONGEST_WAIT_S: Final = 10.0
_STEADY_S: Final = 30.0
"""Who lived this long did not die of its start: the back-off begins anew."""


class Child:
    """Runs ``python -m MODULE`` with a job on its standard input, which stays open while the parent lives."""

    def __init__(self, name: str, module: str) -> None:
        self.name = name
        self._module = module
        self._process: subprocess.Popen[bytes] | None = None
        self._wait_s = _FIRST_WAIT_S
        self._started_s = 0.0
        self._died_s: float | None = None
        self.starts = 0
        """How often it was started."""

    @property
    def pid(self) -> int | None:
        """Process number while it runs."""
        return None if self._process is None else self._process.pid

    def start(self, job: Job) -> None:
        """Start it with ``job``."""
        # A session of its own keeps Ctrl-C at the terminal from it: the supervisor stops its children in order.
        # -P keeps folders of the working directory from being imported in place of ours.
        command = [sys.executable, "-P", "-m", self._module]
        self._process = subprocess.Popen(command, stdin=subprocess.PIPE, start_new_session=True)  # noqa: S603  (ours)
        self._started_s, self._died_s = time.monotonic(), None
        self.starts += 1
        assert self._process.stdin is not None  # noqa: S101  (PIPE)
        try:
            self._process.stdin.write(job.line())
            self._process.stdin.flush()
        except BrokenPipeError:
            return  # it died at once; poll() tells

    def poll(self) -> int | None:
        """Return the exit code once, when it has ended."""
        if self._process is None or self._process.poll() is None:
            return None
        code = self._process.returncode
        self._forget()
        now_s = time.monotonic()
        if now_s - self._started_s > _STEADY_S:
            self._wait_s = _FIRST_WAIT_S
        self._died_s = now_s + self._wait_s
        self._wait_s = min(2 * self._wait_s, _LONGEST_WAIT_S)
        return code

    def is_due(self) -> bool:
        """Whether it died and is to be started again now."""
        return self._died_s is not None and time.monotonic() >= self._died_s

    def ask_to_stop(self) -> None:
        """Ask it to end in order: its standard input ends."""
        self._died_s = None
        self._close_stdin()

    def kill(self) -> None:
        """End it at once."""
        if self._process is not None:
            self._process.kill()
            self._process.wait()
            self._forget()

    def _forget(self) -> None:
        self._close_stdin()
        self._process = None

    def _close_stdin(self) -> None:
        if self._process is not None and self._process.stdin is not None:
            with contextlib.suppress(BrokenPipeError):
                self._process.stdin.close()
