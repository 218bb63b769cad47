"""The mapping algorithm on one screen: from a stationary scan to its place and to the evidence grid."""

from __future__ import annotations

from config.schema import Map
from mapping import grid as grids
from mapping.echoes import pick
from mapping.ensemble import Mixture
from mapping.prior import Hint
from mapping.sight import sight_of
from mapping.stations import Stations
from mapping.values import Grid, Level, Outline, Scan, Station


class Mapper:
    """Places scans one after the other and keeps the evidence grid of those that are placed.

    A function of the configuration and of what it was given, in order: the same calls give the same bytes.
    """

    def __init__(self, config: Map) -> None:
        self._config = config
        self._stations = Stations(config)
        self._grid = grids.empty(config)
        self._hint: Hint | None = None

    def step(self, scan: Scan) -> Station:
        """Take a scan: echoes to returns, returns to a view, the view to a place, all places to the grid."""
        returns = pick(scan, self._config)
        sight = sight_of(scan, returns, self._config)
        station = self._stations.add(sight, self._hint)
        self._grid = self._stations.grid()
        self._hint = None
        return station

    def hint(self, dx_m: float, dy_m: float, sd_m: float) -> None:
        """Take the pilot's word: since the last station the vehicle moved about this far east and north."""
        hint = Hint(dx_m, dy_m, sd_m)
        self._hint = hint if self._hint is None else self._hint.then(hint)

    def drop(self, index: int) -> bool:
        """Leave the station with this scan index out of the map; False where there is no such station."""
        found = self._stations.drop(index)
        self._grid = self._stations.grid()
        return found

    def mixture(self) -> Mixture:
        """Mix the evidence over the places that the stations may have: occupancy, and how sure a wall's place is."""
        return self._stations.mixture()

    @property
    def stations(self) -> tuple[Station, ...]:
        """All stations in the order of their scans."""
        return self._stations.all

    @property
    def grid(self) -> Grid:
        """Evidence of the placed stations; no cells before the first."""
        return self._grid

    @property
    def outlines(self) -> tuple[Outline, ...]:
        """Walls of pieces that nothing ties to the map: to be shown, but no evidence."""
        return self._stations.outlines

    @property
    def levels(self) -> tuple[Level, ...]:
        """What was seen at other depths, where the walls are not those of the map."""
        return self._stations.levels()
