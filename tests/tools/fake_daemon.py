"""A daemon whose sockets are real and whose site is made up (``fake_site``).

``FakeDaemon`` serves it in a thread; as a program, ``python -m tests.tools.fake_daemon [PORT]``, it runs until Ctrl-C.
"""

from __future__ import annotations

import sys
import threading
import time
from collections import deque
from typing import Any, Final

import numpy as np

from config.schema import Publish
from daemon import mapshots, requests, snapshots, wire
from daemon.broker import Broker, Route
from daemon.requests import Request
from daemon.snapshots import Snapshot
from tests.tools.fake_site import filled, grid, mesh, outlines, ping, stations

PINGS_HZ: Final = 40.0


def health(t_ns: int, sonar_state: str = "open") -> Snapshot:
    """Two ports, one of which is silent; a map that is a little late."""
    ports: dict[str, Any] = {
        "sonar": {"state": sonar_state, "rx_bytes_s": 8120.0, "pings_s": 39.8, "last_s": 0.02, "lost": 0, "skipped": 3},
        "pilot": {"state": "open", "rx_bytes_s": 0.0, "readings_s": 0.0, "last_s": 41.0, "lost": 1, "skipped": 0},
    }
    ports["compass"] = {
        "state": "open", "rx_bytes_s": 240.0, "readings_s": 9.8, "last_s": 0.1, "lost": 0, "skipped": 0,
        "bad": {"checksum": 3}, "frames": {"PTNTHTM": 812}, "age_s": {"heading": 0.1}, "stale": [],
        "quality": {"good": 800, "suspect": 9, "bad": 3}, "last_reason": "a jump of 40.0 degrees",
        "now": {"heading": {"quality": "suspect", "reason": "the compass warns: field low (M)"}},
        "field": 31.26, "undisturbed_field": 44.8, "surface": None,
    }  # fmt: skip
    ports["depth"] = {
        "state": "open", "rx_bytes_s": 120.0, "readings_s": 5.0, "last_s": 0.2, "lost": 0, "skipped": 0, "bad": {},
        "age_s": {"depth": 0.2}, "stale": [], "quality": {"good": 400}, "last_reason": "", "field": None,
        "now": {"depth": {"quality": "good", "reason": ""}}, "undisturbed_field": None,
        "surface": {"mbar": 1009.42, "origin": "tare"},
    }  # fmt: skip
    sonar: dict[str, Any] = {"state": "scanning", "range_m": 8.0, "gain_pct": 45.0, "step_deg": 1.8, "sector_deg": None}
    fields: dict[str, Any] = {
        "ports": ports,
        "sonar": sonar,
        "map": {"lag_s": 0.4, "records": 12804},
        "disk_free_mib": 21480.0,
    }
    return snapshots.health(t_ns, time.time_ns(), {**fields, "versions": {"lacuna": "0.1.0"}, "site": "keyhole"})


class FakeDaemon:
    """Serves the site on ``port`` and ``port + 1`` until closed; ``heard`` holds the requests that came."""

    def __init__(self, port: int, session: str = "session-one", keys: str | None = None) -> None:
        self.port = port
        self.heard: list[Request] = []
        self.silent = threading.Event()
        self.sonar_state = "open"
        self._ended = threading.Event()
        self._session = session
        self._more: deque[Snapshot] = deque()
        self._publish = Publish(port=port, request_port=port + 1, keys=keys)
        self._ready = threading.Event()
        self._thread = threading.Thread(target=self._serve, name="fake daemon")
        self._thread.start()
        if not self._ready.wait(10):
            raise TimeoutError("the fake daemon does not start")

    def close(self) -> None:
        """Stop and free the ports."""
        self._ended.set()
        self._thread.join()

    def say(self, *said: Snapshot) -> None:
        """Publish more."""
        self._more.extend(said)

    def _serve(self) -> None:
        with Broker(self._publish, self._session, self._answer) as broker:
            self._broker = broker
            self._say(*self._state())
            self._ready.set()
            rng, number, beaten = np.random.default_rng(1), 0, 0.0
            while not self._ended.is_set():
                broker.turn(1 / PINGS_HZ)
                if self.silent.is_set():
                    continue
                self._say(ping(number, rng))
                number += 1
                if time.monotonic() - beaten > 1:
                    beaten = time.monotonic()
                    self._say(health(number, self.sonar_state))
                while self._more:
                    self._say(self._more.popleft())

    def _state(self) -> list[Snapshot]:
        evidence, unseen, certainty = grid()
        stamp = (0, time.time_ns())
        goals = [{"x_m": -2.2, "y_m": 2.0, "why": "closes the hole in the north-west wall"}]
        guide: dict[str, Any] = {"goals": goals, "open": []}
        return [
            mapshots.grid_key(stamp, evidence),
            mapshots.stations(stamp, stations(), outlines()),
            mapshots.fill(stamp, filled(evidence, unseen, certainty)),
            mapshots.mesh(stamp, mesh()),
            Snapshot("guide", *stamp, guide),
            health(0),
        ]

    def _say(self, *said: Snapshot) -> None:
        for each in said:
            self._broker.publish(wire.encode(each, 0, ""))

    def _answer(self, route: Route, request: Request) -> None:
        self.heard.append(request)
        if request.do == "sonar" and request.fields.get("range_m", 0) > 100:
            refusal = requests.Refusal(request.id, "range", "the head reaches 100 m.", "Ask for less.")
            self._broker.answer(route, requests.refused(refusal))
        else:
            self._broker.answer(route, requests.ok(request.id))


if __name__ == "__main__":
    daemon = FakeDaemon(int(sys.argv[1]) if len(sys.argv) > 1 else 5556)
    try:
        threading.Event().wait()
    except KeyboardInterrupt:
        daemon.close()
