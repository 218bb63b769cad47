"""A real tank from capture to map, and emulated ones: one rectangular room, and neither ringing nor ghosts."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest

from config.errors import DataError, InputError
from config.schema import Map
from mapping.echoes import VAGUE_SD_M, pick
from mapping.values import Scan
from tools.bench.beams import fit_room, judge_beams
from tools.bench.circles import read_circles, recordings
from tools.bench.tank import judge_tank, map_tank, tank_capture
from tools.emulator.echoes import EchoModel, Place, Sampling
from tools.emulator.site import TILE, Site, Stop, Wall, rectangle


@pytest.mark.parametrize("circles", [1, 14])
def test_the_real_tank_is_one_rectangular_room(shared_data: Path, tmp_path: Path, circles: int) -> None:
    grid = map_tank(read_circles(shared_data / "sonar" / "micron-tank-14scans.npz").first(circles), tmp_path)
    figures = judge_tank(grid, circles)
    assert sorted((figures.side_a_m, figures.side_b_m)) == pytest.approx([4.4, 4.6], abs=0.1)
    assert figures.occupied_cells > 200
    assert figures.share_near_walls > 0.97
    assert figures.share_inside < 0.02
    assert figures.share_outside < 0.01
    report = json.loads((tmp_path / "map" / "report.json").read_text())
    assert report["stations"] == {"placed": 1}
    assert (tmp_path / "map" / "plan.png").stat().st_size > 10_000


def test_most_beams_find_the_real_tank_and_those_that_are_sure_are_right(shared_data: Path) -> None:
    figures = judge_beams(read_circles(shared_data / "sonar" / "micron-tank-14scans.npz").scans, Map())
    assert figures.circles == 14
    assert figures.all_near_walls > 0.82
    assert figures.sure > 0.65
    assert figures.sure_near_walls > 0.97


def test_what_is_no_recording_of_a_tank_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="cannot read"):
        read_circles(tmp_path / "none.npz")
    np.savez(tmp_path / "other.npz", a=np.zeros(3))
    with pytest.raises(DataError, match="not a recording"):
        read_circles(tmp_path / "other.npz")
    silent = Scan(
        0, 0, 1, 0.0, math.nan, np.linspace(0.0, 6.28, 200), np.zeros((200, 400), np.uint8), 0.02, 0.0314, "full"
    )
    with pytest.raises(DataError, match="0 sure beams"):
        judge_beams([silent], Map())


def beside_a_wall(width_m: float, length_m: float, x_m: float, seed: int) -> tuple[Scan, np.ndarray]:
    """Circle of a head 17 cm from a tank's wall, ringing to 0.7 m, and the true range of each beam."""
    walls = (Wall(np.array(rectangle(0.0, 0.0, width_m, length_m))),)
    model = EchoModel(Site("tank", walls, floor_m=1.4, stops=(Stop(1, 1, 0.7, 0),), material=TILE), seed)
    bearing = np.linspace(0.0, math.tau, 200, endpoint=False)
    pings = [model.ping(Place(x_m, 0.17, 0.7, 0.0), float(b), Sampling(0.025, 400), i) for i, b in enumerate(bearing)]
    bins_m = (np.arange(400) + 0.5) * 0.025
    ringing_db = np.interp(bins_m, (0.05, 0.06, 0.1, 0.2, 0.5, 0.6, 0.7, 0.8), (-40, 20, 33, 34, 30, 24, 20, -40))
    echoes = np.maximum(np.stack(pings), np.clip(ringing_db * 255.0 / 80.0, 0, 255)).astype(np.uint8)
    scan = Scan(0, 0, 1, 0.0, 0.7, bearing, echoes, 0.025, math.radians(1.8), "full")
    with np.errstate(divide="ignore"):
        to_side = np.where(np.sin(bearing) > 0, width_m - x_m, -x_m) / np.sin(bearing)
        to_end = np.where(np.cos(bearing) > 0, length_m - 0.17, -0.17) / np.cos(bearing)
    return scan, np.minimum(to_side, to_end)


@pytest.mark.parametrize(("width_m", "length_m", "x_m"), [(4.6, 4.4, 1.9), (3.0, 3.6, 1.2), (2.4, 6.0, 1.5)])
def test_a_wall_in_the_ringing_is_seen_and_not_the_room_behind_it(width_m: float, length_m: float, x_m: float) -> None:
    scan, truth_m = beside_a_wall(width_m, length_m, x_m, seed=1)
    returns = pick(scan, Map())
    sure = returns.sd_m < VAGUE_SD_M
    assert sure.mean() > 0.6
    assert np.mean(np.abs(returns.range_m - truth_m)[sure] < 0.1) > 0.93
    assert np.mean(returns.free_m > truth_m + 0.15) < 0.05
    near = truth_m < 0.3
    assert sure[near].mean() > 0.5
    room = fit_room(scan.bearing_rad[sure], returns.range_m[sure])
    assert room is not None
    assert sorted(room.sides_m) == pytest.approx(sorted((width_m, length_m)), abs=0.06)


def saved(path: Path, beams: int, circles: int, bin_m: float) -> Path:
    angle_deg = np.arange(beams * circles) * 360.0 / beams % 360.0
    np.savez(path, angle_deg=angle_deg, bin_m=np.full(3, bin_m), intensity=np.zeros((beams * circles, 50), np.uint8))
    return path


def test_recordings_of_circles_are_found_by_what_is_in_them(tmp_path: Path) -> None:
    (tmp_path / "sonar").mkdir()
    with pytest.raises(InputError, match="no recording of circles"):
        recordings(tmp_path)
    path = saved(tmp_path / "sonar" / "pond.npz", beams=100, circles=3, bin_m=0.025)
    np.savez(tmp_path / "sonar" / "other.npz", angle_deg=np.zeros(3))
    (tmp_path / "sonar" / "broken.npz").write_bytes(b"no archive")
    assert recordings(tmp_path) == [path]
    whole = read_circles(path)
    assert (whole.beams, whole.count, whole.first(2).count, len(whole.scans)) == (100, 3, 2, 3)
    assert whole.scans[1].step_rad == pytest.approx(math.radians(3.6))


def test_a_capture_of_coarser_bins_keeps_the_speed_of_sound_believable(tmp_path: Path) -> None:
    for bin_m in (0.0125, 0.025, 0.05):
        frames, sound_speed_m_s = tank_capture(read_circles(saved(tmp_path / "a.npz", 200, 1, bin_m)))
        assert 1450.0 < sound_speed_m_s < 1550.0
        assert frames.count(b"@") >= 200


def test_a_head_that_does_not_turn_or_turns_less_than_once_makes_no_circle(tmp_path: Path) -> None:
    np.savez(tmp_path / "still.npz", angle_deg=np.zeros(9), bin_m=0.02, intensity=np.zeros((9, 50), np.uint8))
    with pytest.raises(DataError, match="does not turn"):
        read_circles(tmp_path / "still.npz")
    np.savez(tmp_path / "part.npz", angle_deg=np.arange(9.0), bin_m=0.02, intensity=np.zeros((9, 50), np.uint8))
    with pytest.raises(DataError, match="no whole circle"):
        read_circles(tmp_path / "part.npz")
