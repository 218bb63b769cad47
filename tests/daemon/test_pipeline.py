from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import numpy as np
import pytest

from config.schema import Config
from daemon import mapshots
from daemon.cache import LastValues
from daemon.extent import Extent
from daemon.gridstream import GridStream
from daemon.pipeline import Pipeline
from daemon.snapshots import Snapshot
from daemon.state import MapState, grid_digest, mesh_digest, poses_digest
from daemon.wire import decode, encode
from drivers.log import Follower, read_header, read_log
from drivers.readings import Altitude, Depth
from drivers.records import Chunk, Event, Record
from mapping.values import Grid


def digests(state: MapState) -> tuple[str, str, str]:
    return poses_digest(state.stations), grid_digest(state.grid), mesh_digest(state.mesh)


def run(records: Iterable[Record], config: Config) -> tuple[Pipeline, list[Snapshot]]:
    pipeline = Pipeline(config)
    told = [snapshot for record in records for snapshot in pipeline.push(record)]
    return pipeline, told + pipeline.finish()


@pytest.fixture(scope="module")
def mapped(dive_log: Path) -> tuple[Pipeline, list[Snapshot]]:
    return run(read_log(dive_log), read_header(dive_log).config)


def test_a_dive_becomes_a_map(mapped: tuple[Pipeline, list[Snapshot]]) -> None:
    state = mapped[0].state
    assert [station.status for station in state.stations] == ["placed"] * 2
    assert (state.grid.state > 0).sum() > 1000
    assert len(state.mesh.vertices)
    assert state.filled.grid is state.grid


def test_a_follower_and_a_reader_give_the_same_map(mapped: tuple[Pipeline, list[Snapshot]], dive_log: Path) -> None:
    with Follower(dive_log, "dive") as follower:
        records = [record for batch in iter(follower.poll, []) for record in batch]
    again, _ = run(records, read_header(dive_log).config)
    assert digests(again.state) == digests(mapped[0].state)


def test_who_listens_to_the_end_has_the_grid(mapped: tuple[Pipeline, list[Snapshot]]) -> None:
    pipeline, told = mapped
    values = LastValues("s")
    cells, base = np.zeros((0, 0, 0), np.uint8), None
    for snapshot in told:
        frames = values.take(encode(snapshot, 0, ""))
        assert frames is not None
        message = decode(frames)
        fields, arrays = message.snapshot.fields, message.snapshot.arrays
        if message.snapshot.topic == "grid/delta":
            assert fields["base"] == base
            row0, col0 = int(str(fields["row0"])), int(str(fields["col0"]))
            _, rows, cols = arrays["cells"].shape
            cells[:, row0 : row0 + rows, col0 : col0 + cols] = arrays["cells"]
        elif message.snapshot.topic == "grid/key":
            cells = arrays["cells"].copy()
        if message.snapshot.topic.startswith("grid/"):
            base = {"topic": message.snapshot.topic, "seq": message.seq}
    np.testing.assert_array_equal(cells, mapshots.layers(pipeline.state.grid))


def test_each_scan_tells_all_topics(mapped: tuple[Pipeline, list[Snapshot]]) -> None:
    topics = [snapshot.topic for snapshot in mapped[1]]
    assert topics.count("station") == topics.count("fill") == topics.count("mesh") == topics.count("guide") == 2
    newest = [snapshot.fields["newest"] for snapshot in mapped[1] if snapshot.topic == "station"]
    assert newest == [0, 1]


def test_the_whole_state_starts_with_a_key(mapped: tuple[Pipeline, list[Snapshot]]) -> None:
    topics = [snapshot.topic for snapshot in mapped[0].snapshots()]
    assert topics == ["station", "grid/key", "fill", "mesh", "guide"]


def test_an_empty_log_is_an_empty_map() -> None:
    pipeline, told = run([], Config())
    assert told == []
    assert pipeline.state.stations == ()
    assert pipeline.state.grid.state.size == 0
    assert len(pipeline.state.mesh.vertices) == 0
    assert [each.topic for each in pipeline.snapshots()] == ["station", "grid/key", "fill", "mesh", "guide"]


def test_noise_and_unknown_ports_are_no_map() -> None:
    noise = np.random.default_rng(1).integers(0, 256, 20_000, np.uint8).tobytes()
    records: list[Record] = [Chunk(1, 1, "sonar", "rx", noise), Chunk(2, 2, "other", "rx", noise)]
    pipeline, told = run(records, Config())
    assert told == []
    assert pipeline.state.stations == ()


def test_a_dropped_station_leaves_the_map(dive_log: Path) -> None:
    config = read_header(dive_log).config
    pipeline, _ = run(read_log(dive_log), config)
    before = digests(pipeline.state)
    for wrong in (99, -1, "1", None, True):
        assert pipeline.push(Event(1, 1, "drop", {"station": wrong})) == []
    assert digests(pipeline.state) == before
    told = pipeline.push(Event(1, 1, "drop", {"station": 1}))
    assert [station.status for station in pipeline.state.stations] == ["placed", "dropped"]
    assert next(each.topic for each in told) == "station"
    assert digests(pipeline.state) != before


@pytest.mark.parametrize("fields", [{}, {"dx_m": 1.0}, {"dx_m": "x", "dy_m": 0, "sd_m": 1}, {"dx_m": None}])
def test_a_broken_hint_is_ignored(fields: dict[str, object]) -> None:
    pipeline = Pipeline(Config())
    assert pipeline.push(Event(1, 1, "hint", fields)) == []  # type: ignore[arg-type]


def grid(rows: int, cols: int, value: float, x0_m: float = 0.0) -> Grid:
    log_odds = np.full((rows, cols), value, np.float32)
    return Grid(0.05, x0_m, 0.0, log_odds, np.zeros((rows, cols), np.uint8))


def test_when_a_grid_is_told_whole() -> None:
    stream, second = GridStream(), 1_000_000_000
    told = [
        stream.tell((0, 0), grid(2, 2, 0)),
        stream.tell((second, 0), grid(2, 2, 0)),  # nothing new
        stream.tell((second, 0), grid(2, 2, 1)),
        stream.tell((second, 0), grid(2, 3, 1)),  # another size
        stream.tell((second, 0), grid(2, 3, 1, x0_m=-0.05)),  # another place
        stream.tell((2 * second, 0), grid(2, 3, 2, x0_m=-0.05)),
        stream.tell((31 * second, 0), grid(2, 3, 3, x0_m=-0.05)),  # 30 s
        stream.tell((32 * second, 0), grid(2, 3, 3, x0_m=-0.05), whole=True),
    ]
    topics = [each[0].topic if each else "" for each in told]
    key, delta = "grid/key", "grid/delta"
    assert topics == [key, "", delta, key, key, delta, key, key]


def test_a_chain_of_deltas_stays_short() -> None:
    stream = GridStream()
    topics = [stream.tell((0, 0), grid(2, 2, value / 10))[0].topic for value in range(20)]
    assert topics.count("grid/key") == 3


def test_the_walls_stand_between_surface_and_the_deepest_place() -> None:
    extent = Extent(None)
    assert extent.top_and_floor_m() == (0.0, 1.0)
    extent.see(Depth(0, 1.5, "feed"))
    extent.see(Depth(1, 1.2, "feed"))
    assert extent.top_and_floor_m() == (0.0, 1.5)


def test_altitudes_tell_the_floor_and_the_height_the_top() -> None:
    extent = Extent(2.0)
    assert extent.top_and_floor_m() == (0.0, 2.0)
    extent.see(Depth(0, 1.5, "feed"))
    for altitude_m in (0.9, 1.0, 9.0):
        extent.see(Altitude(10, altitude_m, "feed"))
    extent.see(Altitude(10**11, 50.0, "feed"))  # long after the depth
    assert extent.top_and_floor_m() == (0.5, 2.5)
