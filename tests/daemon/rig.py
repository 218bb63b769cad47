"""A real daemon on real pseudo-terminals, for tests."""

from __future__ import annotations

import json
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import zmq

from daemon.wire import Message, decode
from tools.emulator.serve import spawn

PATIENCE_S = 60.0


def free_ports(count: int) -> list[int]:
    probes = [socket.socket() for _ in range(count)]
    for probe in probes:
        probe.bind(("127.0.0.1", 0))
    ports = [int(probe.getsockname()[1]) for probe in probes]
    for probe in probes:
        probe.close()
    return ports


def configuration(folder: Path, sonar: Path | str, ports: tuple[int, int], feed: Path | str | None = None) -> Path:
    """Write a configuration that logs to ``folder``/logs and return its path."""
    lines = ["[site]", 'name = "rig"', "[sonar]", f'port = "{sonar}"']
    lines += ["[[feed]]", f'port = "{feed}"'] if feed else []
    lines += ["[publish]", f"port = {ports[0]}", f"request_port = {ports[1]}"]
    lines += ["[recording]", f'folder = "{folder / "logs"}"', "disk_low_mib = 0.0"]
    path = folder / f"rig-{ports[0]}.toml"
    path.write_text("\n".join(lines) + "\n")
    return path


class Rig:
    """An emulated vehicle if asked for, the daemon, a subscriber to everything and a client for requests."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.logs = folder / "logs"
        self.told: list[Message] = []
        snapshots, requests = free_ports(2)
        self.ports = (snapshots, requests)
        self._processes: list[subprocess.Popen[str]] = []
        self._context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
        self._reader = self.subscriber()
        self._client = self._context.socket(zmq.DEALER)
        self._client.connect(f"tcp://127.0.0.1:{requests}")
        self.daemon: subprocess.Popen[str] | None = None

    def subscriber(self) -> zmq.Socket[bytes]:
        reader = self._context.socket(zmq.SUB)
        reader.subscribe("")
        reader.connect(f"tcp://127.0.0.1:{self.ports[0]}")
        return reader

    def emulate(self, speed: float, stations: int) -> subprocess.Popen[str]:
        process = spawn(self.folder / "ports", "keyhole", 1, speed, stations, None)
        self._processes.append(process)
        assert process.stdout is not None
        assert json.loads(process.stdout.readline())["event"] == "ready"
        return process

    def run(self, config: Path, rate: float = 1.0, map_wait_s: float = PATIENCE_S) -> subprocess.Popen[str]:
        words = ["run", "--json", "--config", str(config), "--clock-rate", str(rate), "--map-wait", str(map_wait_s)]
        command = [sys.executable, "-m", "tools.cli", *words]
        self.daemon = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        self._processes.append(self.daemon)
        return self.daemon

    def wait(self, done: Callable[[], bool]) -> None:
        """Listen until ``done``; fail where the daemon dies or nothing comes of it."""
        end_s = time.monotonic() + PATIENCE_S
        while not done():
            assert time.monotonic() < end_s, f"waited in vain; health was {self.health()}"
            if self.daemon is not None and self.daemon.poll() is not None and self.daemon.stderr is not None:
                raise AssertionError(self.daemon.stderr.read())
            if self._reader.poll(50):
                self.told.append(decode(self._reader.recv_multipart()))

    def ask(self, **body: object) -> dict[str, Any]:
        self._client.send(json.dumps(body).encode())
        self.wait(lambda: bool(self._client.poll(0)))
        answer: dict[str, Any] = json.loads(self._client.recv_multipart()[0])
        return answer

    def newest(self, topic: str) -> Message | None:
        return next((each for each in reversed(self.told) if each.snapshot.topic == topic), None)

    def health(self) -> dict[str, Any]:
        message = self.newest("health")
        return {} if message is None else dict(message.snapshot.fields)

    def pid(self, name: str) -> int | None:
        found: int | None = self.health().get("processes", {}).get(name, {}).get("pid")
        return found

    def count(self, topic: str) -> int:
        return sum(each.snapshot.topic == topic for each in self.told)

    def events(self, kind: str) -> list[dict[str, Any]]:
        told = [each.snapshot.fields for each in self.told if each.snapshot.topic == "event"]
        return [dict(each["fields"]) for each in told if each["kind"] == kind]  # type: ignore[arg-type]

    def kill(self, name: str) -> None:
        """Kill -9 a child and wait until another one runs in its place."""
        self.wait(lambda: self.pid(name) is not None)
        victim = self.pid(name)
        assert victim is not None
        os.kill(victim, signal.SIGKILL)
        self.wait(lambda: self.pid(name) not in (None, victim))

    def stop(self) -> dict[str, Any]:
        """Stop the daemon as Ctrl-C does; return what it says at its end."""
        assert self.daemon is not None
        self.daemon.send_signal(signal.SIGINT)
        out, err = self.daemon.communicate(timeout=PATIENCE_S)
        assert self.daemon.returncode == 0, err
        assert "Traceback" not in err
        outcome: dict[str, Any] = json.loads(out)
        return outcome

    def close(self) -> None:
        for process in self._processes:
            process.kill()
            process.communicate()
        self._reader.close(linger=0)
        self._client.close(linger=0)
        self._context.term()
