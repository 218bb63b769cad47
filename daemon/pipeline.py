"""The way of the data, whole: from a record of the log to snapshots of the map.

Pure: no clock and no input but the records, so the same log gives the same map, live and replayed.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from config.schema import Config
from daemon import mapshots
from daemon.extent import Extent
from daemon.gridstream import GridStream
from daemon.mapshots import Stamp
from daemon.snapshots import Snapshot
from daemon.state import MapState
from drivers.decoders import decoders_for, heed
from drivers.readings import Reading, is_usable
from drivers.records import Chunk, Event, Json, Record
from fill.filler import Filler
from fill.guide import guide
from fill.surface import extrude
from fill.values import Filled, Mesh
from mapping.mapper import Mapper
from mapping.scan import ScanBuilder
from mapping.values import Scan, Station


class Pipeline:
    """Everything between the log and the snapshots, for one session."""

    def __init__(self, config: Config) -> None:
        self._config = config
        self._decoders = decoders_for(config)
        self._scans = ScanBuilder(config.map)
        self._mapper = Mapper(config.map)
        self._filler = Filler(config.fill)
        self._extent = Extent(config.site.height_m)
        self._grids = GridStream()
        self._stamp: Stamp = (0, 0)
        self._drawn: tuple[Filled, Mesh] | None = None

    def push(self, record: Record) -> list[Snapshot]:
        """Take the next record of the log; return what became new by it."""
        self._stamp = (record.t_ns, record.utc_ns)
        match record:
            case Chunk(direction="rx", port=port) if port in self._decoders:
                return self._take(self._decoders[port].push(record.t_ns, record.data))
            case Event():
                return self._obey(record)
            case _:
                return []

    def finish(self) -> list[Snapshot]:
        """Take the end of the log: what waits in decoders and in the open scan; may be called again."""
        told = [snapshot for decoder in self._decoders.values() for snapshot in self._take(decoder.finish())]
        return told + [snapshot for scan in self._scans.finish() for snapshot in self._step(scan)]

    @property
    def state(self) -> MapState:
        """The map as it is."""
        filled, mesh = self._drawn or self._redraw()
        return MapState(self._mapper.stations, self._mapper.grid, filled, mesh, self._mapper.outlines)

    @property
    def whole(self) -> MapState:
        """The map as it is, with its evidence mixed over the poses: for files, since it takes seconds."""
        return replace(self.state, mixture=self._mapper.mixture(), levels=self._mapper.levels)

    def snapshots(self) -> list[Snapshot]:
        """Return the whole state as snapshots, for who begins to listen now; the next grid is a delta to this."""
        return self._tell(whole=True)

    def _take(self, readings: list[Reading]) -> list[Snapshot]:
        told: list[Snapshot] = []
        for reading in filter(is_usable, readings):
            self._extent.see(reading)
            for scan in self._scans.push(reading):
                told += self._step(scan)
        return told

    def _step(self, scan: Scan) -> list[Snapshot]:
        self._mapper.step(scan)
        self._redraw()
        return self._tell()

    def _obey(self, event: Event) -> list[Snapshot]:
        fields = event.fields
        if event.kind == "hint" and _are_numbers(fields, "dx_m", "dy_m", "sd_m"):
            self._mapper.hint(_number(fields["dx_m"]), _number(fields["dy_m"]), _number(fields["sd_m"]))
        station = fields.get("station")
        is_number = isinstance(station, int) and not isinstance(station, bool)
        if event.kind == "drop" and is_number and self._mapper.drop(int(_number(station))):
            self._redraw()
            return self._tell()
        return self._take(heed(self._decoders, event))

    def _redraw(self) -> tuple[Filled, Mesh]:
        filled = self._filler.update(self._mapper.grid)
        self._drawn = filled, extrude(filled, *self._extent.top_and_floor_m())
        return self._drawn

    def _tell(self, whole: bool = False) -> list[Snapshot]:
        state, stamp = self.state, self._stamp
        return [
            mapshots.stations(stamp, state.stations, state.outlines),
            *self._grids.tell(stamp, state.grid, whole),
            mapshots.fill(stamp, state.filled),
            mapshots.mesh(stamp, state.mesh),
            mapshots.guide(stamp, guide(state.filled, _places_m(state.stations)), state.filled.open_ends_m),
        ]


def _places_m(stations: tuple[Station, ...]) -> dict[int, tuple[float, float]]:
    return {each.scan.index: (each.pose.x_m, each.pose.y_m) for each in stations if each.status == "placed"}


def _are_numbers(fields: dict[str, Json], *names: str) -> bool:
    return all(isinstance(fields.get(name), int | float) and np.isfinite(_number(fields[name])) for name in names)


def _number(value: Json) -> float:
    return float(value) if isinstance(value, int | float) else float("nan")
