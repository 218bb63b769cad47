"""Mapping truth: emulated dives through the whole pipeline, bytes in, map out, held against what truly was."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import nan
from typing import Final, Protocol

import numpy as np
from numpy.typing import NDArray

from config.schema import Config, Feed, Site
from daemon.pipeline import Pipeline
from daemon.state import MapState
from drivers.records import Chunk, Record
from mapping.values import Station
from tools.bench.align import Alignment, align, angle_between
from tools.bench.leaning import Walled, WallFigures, judge_walls, plans_of
from tools.emulator.dive import Dive, DiveOptions
from tools.emulator.echoes import Place
from tools.emulator.record import record
from tools.emulator.site import SITES, Stop
from tools.emulator.vehicle import PILOTS, Rest

WITHIN_CELLS: Final = 1.5
"""A wall cell is right if its centre is no farther from true wall than the cell next to the wall's own is."""

WRONG_M: Final = 0.5
"""A placed station farther than this from where it was is wrong, and confident."""

WITHIN_REST: Final = 0.7
"""A scan is of a rest when this share of its time was in it: circles begin while a vehicle still glides in."""

PASSAGES: Final = ("gallery", "loop", "tunnel")
"""Sites that have an axis."""

IN_95: Final = 5.99
"""Square of the distance, in standard deviations, within which 95 % of a normal in the plane lie."""

Floats = NDArray[np.float64]


class Surveyed(Walled, Protocol):
    """A place with the stops of a dive."""

    @property
    def name(self) -> str:
        """What the place is called."""
        ...

    @property
    def stops(self) -> tuple[Stop, ...]:
        """Where the vehicle rests, in order."""
        ...


class Known(Protocol):
    """A dive of which it is known where the vehicle truly was."""

    @property
    def site(self) -> Surveyed:
        """Where the dive was."""
        ...

    @property
    def seed(self) -> int:
        """What chance it was made by."""
        ...

    @property
    def rests(self) -> list[Rest]:
        """The rests so far, in order."""
        ...

    def place_during(self, rest: Rest) -> Place:
        """Return where the vehicle was at a rest, on average."""
        ...


@dataclass(frozen=True, slots=True)
class TruthFigures:
    """One dive held against the truth; lengths in m, angles in degrees, after the best rigid alignment of the stations.

    ``stray`` counts placed stations that were made while the vehicle was under way.  ``covered`` is the share of placed
    stations within their stated 95 % ellipse about the origin's true place; ``across_max_m`` the greatest error across
    a passage and ``along_max_m`` along it, the latter about the origin's true place as the ellipses are, nan at sites
    that are none; ``closure_m`` is the error from the first rest to the last, nan where one is not placed; ``sd_max_m``
    the widest ellipse that was stated.  Walls are judged level by level and counted together (``tools.bench.leaning``).
    """

    site: str
    pilot: str
    seed: int
    rests: int
    placed: int
    unplaced: int
    stray: int
    pieces: int
    levels: int
    wrong: int
    covered: float
    error_median_m: float
    error_95_m: float
    error_max_m: float
    across_max_m: float
    along_max_m: float
    closure_m: float
    sd_max_m: float
    heading_max_deg: float
    wall_precision: float
    wall_recall: float


@dataclass(frozen=True, slots=True)
class Errors:
    """Placed stations against the truth, in true axes, the origin first: ``(n, 2)`` each but ``heading_rad`` ``(n,)``.

    ``fitted_m`` is what the best rigid alignment leaves, ``anchored_m`` the same with the origin at its true place;
    ``covariance`` ``(n, 2, 2)`` is the stated one, ``course`` the direction of the dive at the rest.
    """

    fitted_m: Floats
    anchored_m: Floats
    heading_rad: Floats
    covariance: Floats
    course: Floats

    @property
    def covered(self) -> float:
        """Share within the stated 95 % ellipse, the origin left out; 1 where it is alone."""
        solved = np.linalg.solve(self.covariance[1:], self.anchored_m[1:, :, None])[..., 0]
        inside = (solved * self.anchored_m[1:]).sum(axis=1) <= IN_95
        return float(inside.mean()) if len(inside) else 1.0

    @property
    def off_m(self) -> Floats:
        """Distances ``(n,)`` from where the stations were."""
        return np.asarray(np.linalg.norm(self.fitted_m, axis=1))

    @property
    def across_m(self) -> Floats:
        """Errors across the course ``(n,)``."""
        return np.asarray(np.abs(self.fitted_m[:, 0] * self.course[:, 1] - self.fitted_m[:, 1] * self.course[:, 0]))

    @property
    def along_m(self) -> Floats:
        """Errors along the course ``(n,)``, the origin at its true place."""
        return np.asarray(np.abs((self.anchored_m * self.course).sum(axis=1)))

    @property
    def sd_m(self) -> Floats:
        """Stated standard deviation along the long axis ``(n,)``."""
        return np.asarray(np.sqrt(np.linalg.eigvalsh(self.covariance)[:, 1]))


def dive_records(dive: Dive) -> Iterator[Record]:
    """Yield what the log of a dive holds."""
    for piece in record(dive):
        yield Chunk(piece.t_ns, piece.t_ns, piece.port, "tx" if piece.direction == "tx" else "rx", piece.data)


def measure(site: str, seed: int, pilot: str = "steady", stations: int | None = None) -> TruthFigures:
    """Dive in ``site`` with the default configuration and judge the map."""
    dive = Dive(SITES[site](), seed, DiveOptions(stations=stations, vehicle=PILOTS[pilot]))
    config = Config(site=Site(name=site), feed=(Feed(),))
    pipeline = Pipeline(config)
    for each in dive_records(dive):
        pipeline.push(each)
    pipeline.finish()
    return judge(dive, pipeline.whole, config, pilot)


def judge(dive: Known, state: MapState, config: Config, pilot: str = "steady") -> TruthFigures:
    """Hold the map of a dive against where the vehicle and the walls truly were."""
    rests = dive.rests
    placed = [station for station in state.stations if station.status == "placed"]
    pairs = [(station, rest) for station in placed if (rest := _rest_of(station, rests)) is not None]
    errors, alignment = errors_of(dive, pairs)
    walls = _walls(dive, state, pairs, (alignment, config.sonar.range_m))
    return TruthFigures(
        site=dive.site.name,
        pilot=pilot,
        seed=dive.seed,
        rests=len(rests),
        placed=len({rest.index for _, rest in pairs}),
        unplaced=sum(station.status != "placed" for station in state.stations),
        stray=len(placed) - len(pairs),
        pieces=len({station.piece for station in state.stations}),
        levels=1 + len(state.levels),
        wrong=int((errors.off_m > WRONG_M).sum()),
        covered=round(errors.covered, 3),
        error_median_m=round(float(np.median(errors.off_m)), 4),
        error_95_m=round(float(np.percentile(errors.off_m, 95)), 4),
        error_max_m=round(float(np.max(errors.off_m)), 4),
        across_max_m=_in_passage(dive, errors.across_m),
        along_max_m=_in_passage(dive, errors.along_m),
        closure_m=round(closure_m(errors, [rest.index for _, rest in pairs], len(rests)), 4),
        sd_max_m=round(float(errors.sd_m.max()), 3),
        heading_max_deg=round(float(np.degrees(errors.heading_rad.max())), 3),
        wall_precision=round(walls.precision, 4),
        wall_recall=round(walls.recall, 4),
    )


def _in_passage(dive: Known, errors_m: Floats) -> float:
    return round(float(errors_m.max()), 4) if dive.site.name in PASSAGES else nan


def closure_m(errors: Errors, rests: list[int], count: int) -> float:
    """Error from the first of ``count`` rests to the last one; nan where one of them was not placed."""
    if 0 not in rests or count - 1 not in rests:
        return nan
    return float(np.linalg.norm(errors.fitted_m[rests.index(count - 1)] - errors.fitted_m[rests.index(0)]))


def errors_of(dive: Known, pairs: list[tuple[Station, Rest]]) -> tuple[Errors, Alignment]:
    """Hold placed stations against where the vehicle was on average at their rests."""
    places = [dive.place_during(rest) for _, rest in pairs]
    found_m = np.array([[station.pose.x_m, station.pose.y_m] for station, _ in pairs])
    true_m = np.array([[place.x_m, place.y_m] for place in places])
    turns = [angle_between(s.pose.heading_rad, place.heading_rad) for (s, _), place in zip(pairs, places, strict=True)]
    alignment = align(found_m, true_m, float(np.median(turns)))
    fitted_m = alignment.apply(found_m) - true_m
    turn = Alignment(alignment.clockwise_rad, np.zeros(2)).apply(np.eye(2))
    covariance = np.array([turn.T @ station.covariance[:2, :2] @ turn for station, _ in pairs])
    headings_rad = np.abs([angle_between(alignment.clockwise_rad, turned) for turned in turns])
    return Errors(fitted_m, fitted_m - fitted_m[0], headings_rad, covariance, _courses(dive, pairs)), alignment


def _courses(dive: Known, pairs: list[tuple[Station, Rest]]) -> Floats:
    """Direction ``(n, 2)`` from the stop before each rest to the one after it."""
    stops = dive.site.stops
    ends = [(stops[max(rest.index - 1, 0)], stops[min(rest.index + 1, len(stops) - 1)]) for _, rest in pairs]
    way = np.array([[b.x_m - a.x_m, b.y_m - a.y_m] for a, b in ends])
    return np.asarray(way / np.maximum(np.linalg.norm(way, axis=1), 1e-9)[:, None])


def _rest_of(station: Station, rests: list[Rest]) -> Rest | None:
    scan = station.scan
    for rest in rests:
        during = min(scan.t_end_ns, rest.to_ns or scan.t_end_ns) - max(scan.t_start_ns, rest.from_ns)
        if during > WITHIN_REST * (scan.t_end_ns - scan.t_start_ns):
            return rest
    return None


def _walls(
    dive: Known, state: MapState, pairs: list[tuple[Station, Rest]], map_: tuple[Alignment, float]
) -> WallFigures:
    """Judge the walls of all levels; ``map_`` is the map's alignment and the sonar's range in m."""
    grids = [state.grid, *(level.grid for level in state.levels)]
    deeper = [set(level.scans) for level in state.levels]
    level = [next((1 + k for k, scans in enumerate(deeper) if s.scan.index in scans), 0) for s, _ in pairs]
    at = [
        [dive.place_during(rest) for (_, rest), k in zip(pairs, level, strict=True) if k == n]
        for n in range(len(grids))
    ]
    placed = {rest.index for _, rest in pairs}
    lost = [dive.place_during(rest) for rest in dive.rests if rest.index not in placed]
    return judge_walls(dive.site, plans_of(grids, at, lost), *map_, WITHIN_CELLS)
