"""Health: what the children told of themselves, put together."""

from __future__ import annotations

import os
import time
from importlib.metadata import version
from typing import Any, Final

from config.schema import Config
from daemon import snapshots
from daemon.wire import VERSION, encode
from drivers.records import Json

_HEALTH_S: Final = 1.0


class Status:
    """The newest of everything that the topic ``health`` tells once a second."""

    def __init__(self, session: str, config: Config) -> None:
        self._session = session
        self._config = config
        self._parts: dict[str, Any] = {}
        self._begun_s = time.monotonic()
        self._told_s = 0.0

    @property
    def map(self) -> dict[str, Any]:
        """What the map's process told last."""
        return dict(self._parts.get("map", {}))

    def take(self, header: dict[str, Any]) -> None:
        """Take a child's own health message."""
        ours = ("v", "seq", "session", "t_ns", "utc_ns")
        self._parts |= {key: value for key, value in header.items() if key not in ours}

    def has_lost(self, port: str) -> bool:
        """Whether ``port`` was ever lost."""
        return bool(self._ports().get(port, {}).get("lost"))

    def is_due(self) -> bool:
        """Whether it is time to tell; once a second."""
        now_s = time.monotonic()
        if now_s - self._told_s < _HEALTH_S:
            return False
        self._told_s = now_s
        return True

    def frames(
        self, stamp: tuple[int, int], children: dict[str, tuple[int | None, int]], numbers: dict[str, int]
    ) -> list[bytes]:
        """Return the health message."""
        processes: dict[str, Json] = {
            name: {"pid": pid, "restarts": max(0, starts - 1)} for name, (pid, starts) in children.items()
        }
        self._parts |= {
            "site": self._config.site.name,
            "log_folder": self._config.recording.folder,
            "uptime_s": round(time.monotonic() - self._begun_s, 1),
            "versions": {"lacuna": version("lacuna"), "wire": VERSION},
            "processes": {"supervisor": {"pid": os.getpid(), "restarts": 0}, **processes},
            "newest": dict(numbers),
        }
        if children["acquire"][0] is None:
            # What it told last is no longer so.
            self._parts["ports"] = {name: {**port, "state": "down"} for name, port in self._ports().items()}
        return encode(snapshots.health(*stamp, self._parts), 0, self._session)

    def _ports(self) -> dict[str, Any]:
        return dict(self._parts.get("ports", {}))

    def fields(self) -> dict[str, Json]:
        """Return the newest health for the answer to a request."""
        return {"session": self._session, **self._parts}
