"""The processes of a demo: the emulated vehicle, the daemon, the dashboard."""

from __future__ import annotations

import contextlib
import ctypes
import json
import signal
import socket
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from subprocess import PIPE, Popen, TimeoutExpired
from typing import Any, Final, Self

from config.errors import LacunaError
from drivers.records import Json

_MAP_WAIT_S: Final = 120
_STOP_S: Final = 5.0
_PR_SET_PDEATHSIG: Final = 1


class Crew:
    """Starts and stops them; ``scratch`` takes the ports' names and the configuration, ``folder`` the log.

    ZeroMQ ports are free ones, so that a demo runs beside a real daemon.
    """

    def __init__(
        self, scratch: Path, folder: Path, site: str, speed: float, devices: Mapping[str, Mapping[str, Json]]
    ) -> None:
        """Plan them; ``devices`` has the keys of ``sonar`` and ``feed`` that the emulated devices need."""
        self._devices = devices
        self._scratch = scratch
        self._folder = folder
        self._site = site
        self._speed = speed
        self._ports = _free_ports(3)
        self._emulation: Popen[str] | None = None
        self._daemon: Popen[str] | None = None
        self._dashboard: Popen[str] | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        for process in (self._dashboard, self._daemon, self._emulation):
            if process is not None:
                _end(process)

    def start(self, dive: list[str], truth: Path | None) -> None:
        """Start the vehicle, and when its ports are there the daemon; raise LacunaError where one does not start.

        ``dive`` are the words that tell `lacuna emulate` where and how to dive.
        """
        words = ["emulate", "--json", "--folder", str(self._scratch / "ports"), "--speed", str(self._speed), *dive]
        words += [] if truth is None else ["--truth", str(truth)]
        self._emulation = _started(words)
        if next(self._emulation_events(), {}).get("event") != "ready":
            raise LacunaError("the emulated vehicle did not start; see its message above")
        path = self._scratch / "demo.toml"
        path.write_text(self._configuration(), encoding="utf-8")
        words = ["run", "--json", "--config", str(path)]
        words += ["--clock-rate", str(self._speed), "--map-wait", str(_MAP_WAIT_S)]
        self._daemon = _started(words)

    def open_dashboard(self) -> str:
        """Start the dashboard, which opens the browser; return its address."""
        snapshots, requests, page = self._ports
        words = ["dashboard", "--connect", f"tcp://127.0.0.1:{snapshots}", "--requests", f"tcp://127.0.0.1:{requests}"]
        words += ["--port", str(page), "--open"]
        self._dashboard = _started(words)
        return f"http://127.0.0.1:{page}/"

    def events(self) -> Iterator[dict[str, Any]]:
        """Yield what the vehicle does: ``station``, then ``done``; raise LacunaError where the daemon has ended."""
        for event in self._emulation_events():
            yield event
            self._check_daemon()
        self._check_daemon()

    def stop(self) -> dict[str, Any]:
        """Stop the daemon in order, once the map has read the log; return how it ended."""
        if self._daemon is None:
            return {}
        self._daemon.send_signal(signal.SIGTERM)
        out, _ = self._daemon.communicate(timeout=_MAP_WAIT_S + _STOP_S)
        if self._daemon.returncode:
            raise LacunaError(f"the daemon ended with code {self._daemon.returncode}; see its message above")
        outcome: dict[str, Any] = json.loads(out)
        return outcome

    def _check_daemon(self) -> None:
        if self._daemon is not None and self._daemon.poll() is not None:
            raise LacunaError(f"the daemon ended with code {self._daemon.returncode}; see its message above")

    def _emulation_events(self) -> Iterator[dict[str, Any]]:
        if self._emulation is None or self._emulation.stdout is None:
            return
        # readline, not iteration: a file's iterator reads ahead and would hold events back.
        while line := self._emulation.stdout.readline():
            event: dict[str, Any] = json.loads(line)
            yield event

    def _configuration(self) -> str:
        snapshots, requests, _ = self._ports
        ports = self._scratch / "ports"
        return "\n".join(
            (
                "[site]",
                f"name = {json.dumps(self._site)}",
                "[sonar]",
                f"port = {json.dumps(str(ports / 'sonar'))}",
                *(f"{key} = {json.dumps(value)}" for key, value in self._devices["sonar"].items()),
                "[[feed]]",
                f"port = {json.dumps(str(ports / 'feed'))}",
                *(f"{key} = {json.dumps(value)}" for key, value in self._devices["feed"].items()),
                "[publish]",
                f"port = {snapshots}",
                f"request_port = {requests}",
                "[recording]",
                f"folder = {json.dumps(str(self._folder))}",
                "",
            )
        )


def _started(words: list[str]) -> Popen[str]:
    """Start our own program with ``words``; it is stopped when the demo dies, however that dies."""
    command = [sys.executable, "-P", "-m", "tools.cli", *words]
    # A session of its own keeps Ctrl-C from it: the demo stops its processes in order.
    return Popen(command, stdout=PIPE, text=True, start_new_session=True, preexec_fn=_follow_parent)  # noqa: S603


def _follow_parent() -> None:
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGTERM)


def _free_ports(count: int) -> list[int]:
    with contextlib.ExitStack() as stack:
        probes = [stack.enter_context(socket.socket()) for _ in range(count)]
        for probe in probes:
            probe.bind(("127.0.0.1", 0))
        return [int(probe.getsockname()[1]) for probe in probes]


def _end(process: Popen[str]) -> None:
    process.terminate()
    try:
        process.communicate(timeout=_STOP_S)
    except TimeoutExpired:
        process.kill()
        process.communicate()
