"""The folder of results: each file says what the state says, whole and the same every time."""

from __future__ import annotations

import csv
import io
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from config.errors import DataError, InputError, LogError
from config.schema import Config
from daemon.state import MapState
from fill.filler import filled_grid
from fill.surface import extrude
from fill.values import ASSUMED, FILLED, MEASURED, Hole, Mesh
from mapping.values import FREE, OCCUPIED, UNKNOWN, Grid, Level, Pose, Scan, Station, Status
from tools.maps import read_map
from tools.outputs import write_outputs
from tools.plan import draw_plan
from tools.plan_canvas import FILL_SURE, FREE_WATER, WALL
from tools.plan_marks import round_length_m
from tools.ply import parse_ply, ply_bytes
from tools.provenance import Provenance, config_hash, provenance

FILES = {
    "map.pgm", "map.yaml", "filled.pgm", "filled.yaml", "fills.csv", "holes.csv", "poses.csv", "mesh.ply", "plan.png",
    "plan.pgw", "report.json",
}  # fmt: skip


def station(index: int, status: Status) -> Station:
    scan = Scan(index, 10 + index, 20, 0.5, 1.25, np.zeros(0), np.zeros((0, 4), np.uint8), 0.02, 0.03, "full")
    covariance = np.diag([0.04, 0.01, 0.0001])
    return Station(scan, Pose(1.0 + index, 1.5, 0.5), covariance, status, 0, 9.0, "as told")


@pytest.fixture
def state() -> MapState:
    cells = np.full((50, 80), UNKNOWN, np.uint8)
    cells[5:45, 5:75] = OCCUPIED
    cells[8:42, 8:72] = FREE
    cells[5:8, 30:36] = UNKNOWN
    log_odds = np.select([cells == FREE, cells == OCCUPIED], [-2.0, 2.0], 0.0).astype(np.float32)
    grid = Grid(0.05, -0.5, 0.25, log_odds, cells)
    filling = np.array([[6, col] for col in range(30, 36)], np.int32)
    certainty = np.array([0.9, 0.8, 0.7, 0.7, 0.8, 0.9], np.float32)
    hole = Hole(0, filling, certainty, 0.75, np.array([[1.0, 0.5], [1.3, 0.5]]), 0.3, "line", "the wall, goes on")
    filled = filled_grid(grid, (hole,), np.array([[2.0, 2.0]]))
    stations = (station(0, "placed"), station(1, "doubtful"), station(2, "unplaced"))
    return MapState(stations, grid, filled, extrude(filled, 0.0, 2.0))


@pytest.fixture
def origin() -> Provenance:
    return provenance(Config(), ("dive-1.mcap",), {"skipped_chunks": 2})


def rows(path: Path) -> list[dict[str, str]]:
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def test_all_files_are_there_and_twice_the_same(state: MapState, origin: Provenance, tmp_path: Path) -> None:
    write_outputs(tmp_path / "one", state, origin)
    write_outputs(tmp_path / "two", state, origin)
    write_outputs(tmp_path / "two", state, origin)  # a second run replaces what stands there
    assert {path.name for path in (tmp_path / "two").iterdir()} == FILES
    for name in FILES:
        assert (tmp_path / "one" / name).read_bytes() == (tmp_path / "two" / name).read_bytes(), name


def test_levels_of_a_well_have_maps_of_their_own(state: MapState, origin: Provenance, tmp_path: Path) -> None:
    level = Level(2.5, (4, 5), state.grid)
    facts = write_outputs(tmp_path / "out", replace(state, levels=(level,)), origin)
    assert facts["levels"] == [{"depth_m": 2.5, "stations": [4, 5]}]
    np.testing.assert_array_equal(read_map(tmp_path / "out" / "map-level-2.yaml").grid.state, state.grid.state)
    write_outputs(tmp_path / "out", state, origin)
    assert {path.name for path in (tmp_path / "out").iterdir()} == FILES


def test_maps_keep_measured_and_filled_apart(state: MapState, origin: Provenance, tmp_path: Path) -> None:
    write_outputs(tmp_path, state, origin)
    measured, filled = read_map(tmp_path / "map.yaml").grid, read_map(tmp_path / "filled.yaml").grid
    assert np.array_equal(measured.state, state.grid.state)
    assert (measured.x0_m, measured.y0_m, measured.cell_m) == (-0.5, 0.25, 0.05)
    changed = filled.state != measured.state
    assert np.array_equal(changed, state.filled.hole >= 0)
    assert np.all(filled.state[changed] == OCCUPIED)
    grey = np.flipud(np.asarray(Image.open(tmp_path / "filled.pgm")))
    assert np.all(grey[changed] > 0)


def test_tables_count_rows_from_the_top_of_the_picture(state: MapState, origin: Provenance, tmp_path: Path) -> None:
    write_outputs(tmp_path, state, origin)
    fills = rows(tmp_path / "fills.csv")
    assert [(int(each["row"]), int(each["col"])) for each in fills] == [(43, col) for col in range(30, 36)]
    assert [float(each["certainty"]) for each in fills] == pytest.approx([0.9, 0.8, 0.7, 0.7, 0.8, 0.9])
    hole = rows(tmp_path / "holes.csv")[0]
    assert (hole["certainty"], hole["cells"], hole["why"]) == ("0.7500", "6", "the wall, goes on")
    poses = rows(tmp_path / "poses.csv")
    assert [each["status"] for each in poses] == ["placed", "doubtful", "unplaced"]
    assert float(poses[1]["x_m"]) == 2.0
    assert float(poses[0]["heading_deg"]) == pytest.approx(28.648, abs=1e-3)
    assert float(poses[0]["sd_x_m"]) == 0.2
    assert float(poses[0]["depth_m"]) == 1.25


def test_the_report_tells_counts_versions_and_digests(state: MapState, origin: Provenance, tmp_path: Path) -> None:
    write_outputs(tmp_path, state, origin)
    told = json.loads((tmp_path / "report.json").read_text())
    assert told["stations"] == {"placed": 1, "doubtful": 1, "unplaced": 1}
    assert told["fills"] == {"holes": 1, "cells": 6, "mean_certainty": 0.8, "open_ends": 1, "noise_ends": 0}
    assert told["logs"] == ["dive-1.mcap"]
    assert told["damage"] == {"skipped_chunks": 2}
    assert told["config_hash"] == config_hash(Config())
    assert all(len(digest) == 64 for digest in told["sha256"].values())


def test_a_folder_that_cannot_be_is_one_line(state: MapState, origin: Provenance, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="cannot make folder"):
        write_outputs(tmp_path / "file" / "below", state, origin)
    (tmp_path / "map.pgm.part").mkdir()
    with pytest.raises(LogError, match=r"cannot write .*map\.pgm"):
        write_outputs(tmp_path, state, origin)


def test_a_full_disk_leaves_the_old_file_whole(
    state: MapState, origin: Provenance, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_outputs(tmp_path, state, origin)
    before = (tmp_path / "map.pgm").read_bytes()

    def full(_: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("tools.files.os.fsync", full)
    with pytest.raises(LogError, match="No space left on device"):
        write_outputs(tmp_path, state, origin)
    assert (tmp_path / "map.pgm").read_bytes() == before
    assert not list(tmp_path.glob("*.part"))


def test_ply_reads_back_with_class_and_certainty(state: MapState) -> None:
    data = ply_bytes(state.mesh, ("a site", "made by\na test"))
    again = parse_ply(data)
    assert again.vertices.tobytes() == state.mesh.vertices.tobytes()
    assert np.array_equal(again.triangles, state.mesh.triangles)
    assert np.array_equal(again.kind, state.mesh.kind)
    assert again.certainty.tobytes() == state.mesh.certainty.tobytes()
    assert {MEASURED, FILLED, ASSUMED} == set(np.unique(again.kind).tolist())
    assert b"property uchar class\nproperty float certainty\n" in data
    assert b"comment made by a test\n" in data


@pytest.mark.parametrize("cut", [0, 20, 200, -1])
def test_what_is_not_a_whole_ply_is_bad_data(state: MapState, cut: int) -> None:
    with pytest.raises(DataError, match=r"mesh\.ply"):
        parse_ply(ply_bytes(state.mesh)[:cut])


def test_an_empty_mesh_is_a_ply(state: MapState) -> None:
    empty = Mesh(
        np.zeros((0, 3), np.float32), np.zeros((0, 3), np.uint32), np.zeros(0, np.uint8), np.zeros(0, np.float32)
    )
    assert len(parse_ply(ply_bytes(empty)).vertices) == 0


def pixel_of(world: str, x_m: float, y_m: float) -> tuple[int, int]:
    size, _, _, down, west, north = (float(line) for line in world.split())
    return round((x_m - west) / size), round((y_m - north) / down)


def test_the_plan_shows_classes_where_its_world_file_says(state: MapState, origin: Provenance) -> None:
    plan = draw_plan(state.filled, state.stations, origin)
    image = Image.open(io.BytesIO(plan.png)).convert("RGB")
    assert image.getpixel(pixel_of(plan.world, 0.0, 1.0)) == FREE_WATER
    assert image.getpixel(pixel_of(plan.world, -0.175, 1.0)) == WALL
    x, y = pixel_of(plan.world, 1.15, 0.575)
    around = np.asarray(image.crop((x - 30, y - 4, x + 30, y + 5))).reshape(-1, 3).astype(int)
    orange = (around[:, 0] > 190) & (around[:, 2] < 110)
    assert orange.any()
    assert not orange.all()  # stripes: told apart by more than colour
    assert np.abs(np.array(FILL_SURE) - WALL).max() > 100


def test_a_plan_of_nothing_can_be_drawn(origin: Provenance) -> None:
    for shape in ((0, 0), (1, 1), (40, 40)):
        grid = Grid(0.05, 0.0, 0.0, np.zeros(shape, np.float32), np.zeros(shape, np.uint8))
        assert draw_plan(filled_grid(grid, (), np.zeros((0, 2))), (), origin).png.startswith(b"\x89PNG")


@pytest.mark.parametrize(("room_m", "length_m"), [(0.9, 0.5), (1.0, 1.0), (7.3, 5.0), (49.0, 20.0)])
def test_scale_bars_have_round_lengths(room_m: float, length_m: float) -> None:
    assert round_length_m(room_m) == pytest.approx(length_m)
