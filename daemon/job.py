"""What the supervisor tells a child when it starts it: one line of JSON on the child's standard input.

The input stays open for as long as the supervisor lives; its end tells the child that it is alone.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from pathlib import Path

from config.schema import Config
from daemon.clock import Clock
from drivers.records import Json


@dataclass(frozen=True, slots=True)
class Job:
    """``link`` is the supervisor's socket; ``is_first`` is false for a child that takes over from one that died.

    ``surfaces_mbar``: pressures at the surface, by feed, that the operator has taken in this session; ``settings``:
    how the operator has set the sonar since its start, as the request ``sonar`` says it.
    """

    link: str
    session: str
    config: Config
    clock: Clock
    is_first: bool
    surfaces_mbar: dict[str, float] = field(default_factory=dict)
    settings: dict[str, Json] = field(default_factory=dict)

    @property
    def folder(self) -> Path:
        """Folder of the session's log."""
        return Path(self.config.recording.folder)

    def line(self) -> bytes:
        """Return the job as a line."""
        body = {
            "link": self.link,
            "session": self.session,
            "config": self.config.model_dump(mode="json"),
            "rate": self.clock.rate,
            "origin_ns": list(self.clock.origin_ns),
            "is_first": self.is_first,
            "surfaces_mbar": self.surfaces_mbar,
            "settings": self.settings,
        }
        return json.dumps(body).encode() + b"\n"


def read_job(line: bytes) -> Job:
    """Return the job in ``line``."""
    body = json.loads(line)
    clock = Clock(body["rate"], tuple(body["origin_ns"]))
    config = Config.model_validate(body["config"])
    carried = body["surfaces_mbar"], body["settings"]
    return Job(body["link"], body["session"], config, clock, body["is_first"], *carried)
