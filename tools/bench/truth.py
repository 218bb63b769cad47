"""Mapping truth: emulated dives through the whole pipeline, bytes in, map out, held against what truly was."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from config.schema import Config, Feed, Site
from daemon.pipeline import Pipeline
from daemon.state import MapState
from drivers.records import Chunk, Record
from mapping.values import OCCUPIED, Station
from tools.bench.align import Alignment, align, angle_between
from tools.bench.walls import distance_to_walls_m, walls_in_view_m
from tools.emulator.dive import Dive, DiveOptions
from tools.emulator.record import record
from tools.emulator.site import SITES
from tools.emulator.vehicle import Rest

WITHIN_CELLS: Final = 1.5
"""A wall cell is right if its centre is no farther from true wall than the cell next to the wall's own is."""

WRONG_M: Final = 0.5
"""A placed station farther than this from where it was is wrong, and confident."""


@dataclass(frozen=True, slots=True)
class TruthFigures:
    """One dive held against the truth; lengths in m, angles in degrees, after the best rigid alignment of the stations.

    ``stray`` counts placed stations that were made while the vehicle was under way.
    """

    site: str
    seed: int
    rests: int
    placed: int
    unplaced: int
    stray: int
    pieces: int
    wrong: int
    error_median_m: float
    error_95_m: float
    error_max_m: float
    heading_max_deg: float
    wall_precision: float
    wall_recall: float


def dive_records(dive: Dive) -> Iterator[Record]:
    """Yield what the log of a dive holds."""
    for piece in record(dive):
        yield Chunk(piece.t_ns, piece.t_ns, piece.port, "tx" if piece.direction == "tx" else "rx", piece.data)


def measure(site: str, seed: int, stations: int | None = None) -> TruthFigures:
    """Dive in ``site`` with the default configuration and judge the map."""
    dive = Dive(SITES[site](), seed, DiveOptions(stations=stations))
    config = Config(site=Site(name=site), feed=(Feed(),))
    pipeline = Pipeline(config)
    for each in dive_records(dive):
        pipeline.push(each)
    pipeline.finish()
    return judge(dive, pipeline.state, config)


def judge(dive: Dive, state: MapState, config: Config) -> TruthFigures:
    """Hold the map of a dive against where the vehicle and the walls truly were."""
    rests = dive.vehicle.rests
    placed = [station for station in state.stations if station.status == "placed"]
    pairs = [(station, rest) for station in placed if (rest := _rest_of(station, rests)) is not None]
    found_m = np.array([[station.pose.x_m, station.pose.y_m] for station, _ in pairs])
    true_m = np.array([[rest.stop.x_m, rest.stop.y_m] for _, rest in pairs])
    turn_rad = float(np.median([angle_between(s.pose.heading_rad, r.stop.heading_rad) for s, r in pairs]))
    alignment = align(found_m, true_m, turn_rad)
    errors_m = np.linalg.norm(alignment.apply(found_m) - true_m, axis=1)
    headings_rad = [
        abs(angle_between(s.pose.heading_rad + alignment.clockwise_rad, r.stop.heading_rad)) for s, r in pairs
    ]
    precision, recall = _walls(dive, state, alignment, config)
    return TruthFigures(
        site=dive.site.name,
        seed=dive.seed,
        rests=len(rests),
        placed=len({rest.index for _, rest in pairs}),
        unplaced=sum(station.status != "placed" for station in state.stations),
        stray=len(placed) - len(pairs),
        pieces=len({station.piece for station in state.stations}),
        wrong=int((errors_m > WRONG_M).sum()),
        error_median_m=round(float(np.median(errors_m)), 4),
        error_95_m=round(float(np.percentile(errors_m, 95)), 4),
        error_max_m=round(float(np.max(errors_m)), 4),
        heading_max_deg=round(float(np.degrees(max(headings_rad))), 3),
        wall_precision=round(precision, 4),
        wall_recall=round(recall, 4),
    )


def _rest_of(station: Station, rests: list[Rest]) -> Rest | None:
    scan = station.scan
    for rest in rests:
        during = min(scan.t_end_ns, rest.to_ns or scan.t_end_ns) - max(scan.t_start_ns, rest.from_ns)
        if during > 0.8 * (scan.t_end_ns - scan.t_start_ns):
            return rest
    return None


def _walls(dive: Dive, state: MapState, alignment: Alignment, config: Config) -> tuple[float, float]:
    grid = state.grid
    rows, cols = np.nonzero(grid.state == OCCUPIED)
    cells_m = np.stack([grid.x0_m + (cols + 0.5) * grid.cell_m, grid.y0_m + (rows + 0.5) * grid.cell_m], axis=1)
    cells_m = alignment.apply(cells_m)
    lines = [(wall.points_m, wall.closed) for wall in dive.site.walls]
    within_m = WITHIN_CELLS * grid.cell_m
    precision = float(np.mean(distance_to_walls_m(cells_m, lines) <= within_m)) if len(cells_m) else 0.0
    seen_from_m = np.array([[rest.stop.x_m, rest.stop.y_m] for rest in dive.vehicle.rests])
    in_view_m = walls_in_view_m(lines, seen_from_m, config.sonar.range_m)
    return precision, _share_near(in_view_m, cells_m, within_m)


def _share_near(points_m: NDArray[np.float64], cells_m: NDArray[np.float64], within_m: float) -> float:
    if not len(points_m) or not len(cells_m):
        return 0.0
    nearest = [np.min(np.hypot(*(cells_m - point).T)) for point in points_m]
    return float(np.mean(np.array(nearest) <= within_m))
