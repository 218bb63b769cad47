"""The dashboard as people start it: the command in a process of its own, on free ports."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True, slots=True)
class Dashboard:
    """A running dashboard and where it is."""

    url: str
    process: subprocess.Popen[str]


def free_port() -> int:
    """A port that is free, with a free one after it."""
    while True:
        with socket.socket() as first, socket.socket() as second:
            first.bind(("127.0.0.1", 0))
            port = int(first.getsockname()[1])
            try:
                second.bind(("127.0.0.1", port + 1))
            except (OSError, OverflowError):
                continue
            return port


def lacuna(*words: str, env: dict[str, str] | None = None) -> subprocess.CompletedProcess[str]:
    """Run a command to its end."""
    return subprocess.run(
        [sys.executable, "-m", "tools.cli", *words], capture_output=True, text=True, timeout=60, check=False, env=env
    )


@contextmanager
def dashboard(port: int, *words: str) -> Iterator[Dashboard]:
    """Serve the page of the daemon at ``port``; end it as people do, with Ctrl-C."""
    addresses = ["--connect", f"tcp://127.0.0.1:{port}", "--requests", f"tcp://127.0.0.1:{port + 1}"]
    command = [sys.executable, "-m", "tools.cli", "dashboard", *addresses, "--port", "0", *words]
    root = Path(__file__).resolve().parents[2]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=root, env={**os.environ}
    ) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        try:
            line = process.stdout.readline()
            assert line.startswith("dashboard: http://"), line + process.stderr.read()
            yield Dashboard(line.split()[1], process)
        finally:
            process.send_signal(signal.SIGINT)
            complaint = process.communicate(timeout=20)[1]
        assert "Traceback" not in complaint, complaint
        assert process.returncode == 130
