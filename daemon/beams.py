"""From records to the beams that are published at once, without waiting for the map."""

from __future__ import annotations

from config.schema import Config
from daemon import snapshots
from daemon.snapshots import Snapshot
from drivers.counters import Counters
from drivers.decoders import decoders_for
from drivers.readings import Depth, Heading, Ping
from drivers.records import Chunk


class Beams:
    """Decodes what came from the ports and remembers heading and depth, which a beam is shown with."""

    def __init__(self, config: Config) -> None:
        self._decoders = decoders_for(config)
        self._heading_rad: float | None = None
        self._depth_m: float | None = None
        self.pings = 0
        """Beams decoded so far."""

    def push(self, chunk: Chunk) -> list[Snapshot]:
        """Return the beams that ``chunk`` completes."""
        decoder = self._decoders.get(chunk.port)
        if decoder is None or chunk.direction != "rx":
            return []
        told: list[Snapshot] = []
        for reading in decoder.push(chunk.t_ns, chunk.data):
            match reading:
                case Heading():
                    self._heading_rad = reading.heading_rad
                case Depth():
                    self._depth_m = reading.depth_m
                case Ping():
                    told.append(snapshots.ping(reading, chunk.utc_ns, self._heading_rad, self._depth_m))
        self.pings += len(told)
        return told

    def counters(self, port: str) -> Counters:
        """Return what the decoder of ``port`` has seen."""
        return self._decoders[port].counters
