"""Where a result comes from: what every file for people carries."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass, field
from importlib.metadata import version

from config.schema import Config
from drivers.records import Json


@dataclass(frozen=True, slots=True)
class Provenance:
    """Site, program version, configuration hash, log names, the north in use, and what was damaged in the logs."""

    site: str
    version: str
    config_hash: str
    logs: tuple[str, ...]
    north: str
    damage: dict[str, Json] = field(default_factory=dict)

    @property
    def line(self) -> str:
        """All of it but the damage, in one line."""
        logs = ", ".join(self.logs) if self.logs else "none"
        return f"lacuna {self.version}, configuration {self.config_hash}, {self.north}, logs: {logs}"


def config_hash(config: Config) -> str:
    """First 12 hex digits of the SHA-256 over the effective configuration as canonical JSON."""
    text = json.dumps(config.model_dump(mode="json"), sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()[:12]


def provenance(config: Config, logs: tuple[str, ...], damage: dict[str, Json] | None = None) -> Provenance:
    """Tell where a result made with ``config`` from ``logs`` comes from."""
    turn = config.site.declination_deg
    north = f"north: magnetic {turn:+.1f} deg" if turn else "north: as the compass tells"
    return Provenance(config.site.name, version("lacuna"), config_hash(config), logs, north, damage or {})
