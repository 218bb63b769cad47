from __future__ import annotations

import gzip
import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from config.schema import Config, Feed, Map
from drivers.decoders import decoders_for
from drivers.readings import Reading
from mapping.mapper import Mapper
from mapping.scan import ScanBuilder
from mapping.values import OCCUPIED, Grid, Scan, Station
from tests.mapping.rooms import KEYHOLE, RECTANGLE, TUNNEL, Stay, pings
from tests.mapping.test_scan_builder import build, tank

PLACES = [Stay(0.3, -0.5, 0.4, 330), Stay(0.1, 2.0, 1.2, 330, glide=250), Stay(0.2, 4.7, 5.9, 330, glide=280)]


def scans_in(walls: np.ndarray, stays: list[Stay]) -> list[Scan]:
    return build(list(pings(walls, stays, np.random.default_rng(3))))


@pytest.fixture(scope="module")
def keyhole() -> list[Scan]:
    return scans_in(KEYHOLE, PLACES)


def mapped(scans: list[Scan], config: Map | None = None) -> Mapper:
    mapper = Mapper(config or Map())
    for scan in scans:
        mapper.step(scan)
    return mapper


def offset(station: Station, stay: Stay, origin: Stay) -> float:
    return math.hypot(station.pose.x_m - stay.x_m + origin.x_m, station.pose.y_m - stay.y_m + origin.y_m)


def test_stations_are_placed_where_they_were(keyhole: list[Scan]) -> None:
    mapper = mapped(keyhole)
    assert [s.status for s in mapper.stations] == ["placed"] * 3
    for station, stay in zip(mapper.stations, PLACES, strict=True):
        assert offset(station, stay, PLACES[0]) < 0.1
        assert math.degrees(abs(station.pose.heading_rad - stay.heading_rad)) < 2.0
    assert mapper.stations[0].pose.x_m == mapper.stations[0].pose.y_m == 0.0
    assert math.isnan(mapper.stations[0].margin)


def test_stated_errors_are_honest(keyhole: list[Scan]) -> None:
    for station, stay in list(zip(mapped(keyhole).stations, PLACES, strict=True))[1:]:
        off = np.array([station.pose.x_m - stay.x_m + 0.3, station.pose.y_m - stay.y_m - 0.5])
        assert off @ np.linalg.solve(station.covariance[:2, :2], off) < 9.0
        assert np.linalg.eigvalsh(station.covariance).min() > 0.0


def test_where_stations_are_does_not_hang_on_the_size_of_the_maps_cells(keyhole: list[Scan]) -> None:
    usual, coarse = mapped(keyhole), mapped(keyhole, Map(cell_m=0.1))
    assert coarse.grid.cell_m == 0.1
    assert [station.pose for station in coarse.stations] == [station.pose for station in usual.stations]
    assert [station.status for station in coarse.stations] == ["placed"] * 3


def test_the_same_scans_give_the_same_bytes(keyhole: list[Scan]) -> None:
    one, two = mapped(keyhole), mapped(keyhole)
    assert one.grid.log_odds.tobytes() == two.grid.log_odds.tobytes()
    assert [s.pose for s in one.stations] == [s.pose for s in two.stations]
    for a, b in zip(one.stations, two.stations, strict=True):
        assert a.covariance.tobytes() == b.covariance.tobytes()


def tunnel() -> list[Scan]:
    """Two rests in a tunnel, taken apart: whoever drives along smooth walls seems to rest."""
    (first,) = scans_in(TUNNEL, [Stay(0.0, 0.1, 0.2, 330)])
    (second,) = scans_in(TUNNEL, [Stay(2.0, -0.1, 0.3, 330)])
    return [first, replace(second, index=1)]


def test_a_tunnel_is_not_placed_and_its_direction_is_told() -> None:
    first, second = mapped(tunnel()).stations
    assert first.status == "placed"
    assert second.status in ("doubtful", "unplaced")
    words = second.why.split()
    assert "slide" in words
    along = int(words[words.index("along") + 1])
    assert min(abs(along - 90), abs(along - 270)) <= 12


def test_a_hint_places_what_would_slide() -> None:
    scans = tunnel()
    mapper = Mapper(Map())
    mapper.step(scans[0])
    mapper.hint(2.0, -0.2, 0.1)
    station = mapper.step(scans[1])
    assert offset(station, Stay(2.0, -0.1, 0.3, 0), Stay(0.0, 0.1, 0.2, 0)) < 0.5


def test_a_scan_of_another_room_is_not_forced_into_the_map(keyhole: list[Scan]) -> None:
    (foreign,) = scans_in(RECTANGLE, [Stay(1.0, -0.4, 0.7, 330)])
    station = mapped([keyhole[0], replace(foreign, index=1)]).stations[1]
    assert station.status != "placed"
    assert station.why


def test_a_dropped_station_leaves_the_grid(keyhole: list[Scan]) -> None:
    mapper = mapped(keyhole)
    whole = mapper.grid
    assert mapper.drop(keyhole[2].index)
    assert mapper.stations[2].status == "dropped"
    assert np.abs(mapper.grid.log_odds).sum() < 0.95 * np.abs(whole.log_odds).sum()
    assert not mapper.drop(99)


def test_before_the_first_scan_there_is_no_cell() -> None:
    mapper = Mapper(Map())
    assert mapper.grid.state.shape == (0, 0)
    assert mapper.stations == ()


def test_a_scan_without_walls_waits_and_does_not_begin_the_map(keyhole: list[Scan]) -> None:
    far = np.array([[-90.0, -90.0], [90.0, -90.0], [90.0, 90.0], [-90.0, 90.0]])
    (empty,) = scans_in(far, [Stay(0.0, 0.0, 0.0, 200)])
    mapper = mapped([empty, keyhole[0]])
    assert [s.status for s in mapper.stations] == ["unplaced", "placed"]
    assert mapper.stations[1].pose.x_m == 0.0


def test_scans_at_another_depth_fit_a_well_that_widens() -> None:
    turn = np.arange(60) / 60.0 * 2.0 * math.pi
    radius = 2.0 + 0.3 * np.cos(3.0 * turn) + 0.2 * np.sin(2.0 * turn)
    well = np.stack([radius * np.sin(turn), radius * np.cos(turn)], axis=1)
    upper = scans_in(well, [Stay(0.0, 0.0, 0.0, 330, depth_m=1.0)])
    (lower,) = scans_in(well * 1.3, [Stay(-0.5, 0.4, 0.5, 330, depth_m=2.5)])
    station = mapped([*upper, lower]).stations[1]
    assert station.status == "placed"
    assert math.hypot(station.pose.x_m + 0.5, station.pose.y_m - 0.4) < 0.25


def fitted_share(grid: Grid) -> tuple[float, float, float]:
    """Share of occupied cells within 10 cm of the fitted rectangle, and its two sides."""
    row, col = np.nonzero(grid.state == OCCUPIED)
    xy = np.stack([(col + 0.5) * grid.cell_m, (row + 0.5) * grid.cell_m], axis=1)
    best = (0.0, 0.0, 0.0)
    for turn in np.radians(np.arange(0.0, 90.0, 0.5)):
        u = xy @ [math.cos(turn), math.sin(turn)]
        v = xy @ [-math.sin(turn), math.cos(turn)]
        edges = [_edge(w) for w in (u, -u, v, -v)]
        off = np.minimum.reduce([np.abs(w - e) for w, e in zip((u, -u, v, -v), edges, strict=True)])
        share = float(np.mean(off < 0.1))
        best = max(best, (share, -edges[0] - edges[1], -edges[2] - edges[3]))
    return best


def _edge(w: np.ndarray) -> float:
    """Where the most cells line up in the outer fifth."""
    low = w[w < np.quantile(w, 0.35)]
    counts, bounds = np.histogram(low, bins=np.arange(low.min(), low.max() + 0.05, 0.05))
    k = int(np.argmax(counts))
    return float(low[(low >= bounds[k] - 0.05) & (low <= bounds[k] + 0.1)].mean())


@pytest.mark.parametrize("circles", [1, 2, 14])
def test_the_real_tank_is_one_rectangular_room(shared_data: Path, circles: int) -> None:
    mapper = mapped(build(tank(shared_data, 200 * circles)))
    assert [s.status for s in mapper.stations] == ["placed"]
    share, one, other = fitted_share(mapper.grid)
    assert share > 0.9
    assert sorted((one, other)) == pytest.approx([4.4, 4.6], abs=0.12)


def readings_of(dive: Path) -> list[Reading]:
    config = Config(feed=(Feed(name="feed"),))
    decoders = decoders_for(config)
    readings: list[Reading] = []
    with gzip.open(dive, "rt") as lines:
        for line in lines:
            entry: dict[str, Any] = json.loads(line)
            if entry["dir"] == "rx":
                readings += decoders[entry["port"]].push(entry["t_ns"], bytes.fromhex(entry["hex"]))
    return readings


@pytest.mark.slow
@pytest.mark.parametrize(("site", "stations", "median_m"), [("pool", 6, 0.05), ("bell", 5, 0.15)])
def test_every_station_of_a_foreign_emulators_dive_is_placed_right(
    shared_data: Path, site: str, stations: int, median_m: float
) -> None:
    truth = json.loads((shared_data / "dives" / f"{site}.truth.json").read_text())["stations"]
    builder, config = ScanBuilder(Map()), Map()
    scans = [scan for r in readings_of(shared_data / "dives" / f"{site}.jsonl.gz") for scan in builder.push(r)]
    mapper = mapped(scans + builder.finish(), config)
    assert [s.status for s in mapper.stations] == ["placed"] * stations
    turn = mapper.stations[0].pose.heading_rad - math.radians(truth[0]["heading"])
    errors = []
    for station, true in zip(mapper.stations, truth, strict=True):
        dx, dy = true["x"] - truth[0]["x"], true["y"] - truth[0]["y"]
        x, y = math.cos(turn) * dx + math.sin(turn) * dy, math.cos(turn) * dy - math.sin(turn) * dx
        errors.append(math.hypot(station.pose.x_m - x, station.pose.y_m - y))
    assert np.median(errors[1:]) < median_m
    assert max(errors) < 0.3
