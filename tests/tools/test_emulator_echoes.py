"""Echoes against figures measured on recordings of real Micron heads in rectangular tanks."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from tools.emulator.echoes import EchoModel, Place, Sampling
from tools.emulator.fan import View
from tools.emulator.rays import NOTHING_M, Segments, cast, corners, trace
from tools.emulator.scene import Scene
from tools.emulator.site import ROCK, SITES, TILE, Site, Wall, rectangle
from tools.emulator.speckle import STEP_M, Speckle

DB = 80.0 / 255.0
BIN_M = 0.0125
BEARINGS = np.radians(np.arange(200) * 1.8)
WEST, SOUTH, EAST, NORTH = -2.7, -2.4, 1.9, 2.0
TANK = Site("tank", (Wall(np.array(rectangle(WEST, SOUTH, EAST, NORTH))),), floor_m=4.0, stops=(), material=TILE)
"""About the plan of the recorded tank; its depth is not known, but no arc of a floor is seen in it."""

HERE = Place(0.0, 0.0, 2.0, 0.0)

Floats = NDArray[np.float64]


def circle(model: EchoModel, place: Place = HERE, first: int = 0) -> Floats:
    """One full circle in counts, ``(200, 399)``."""
    pings = [model.ping(place, float(b), Sampling(BIN_M, 399), first + i) for i, b in enumerate(BEARINGS)]
    return np.array(pings).astype(np.float64)


@pytest.fixture(scope="module")
def scans() -> list[Floats]:
    return [circle(EchoModel(TANK, seed)) for seed in range(3)]


def truth() -> tuple[Floats, Floats, Floats]:
    """Range and incidence (degrees) of the tank's wall, and distance to the nearest corner, by bearing."""
    east, north = np.sin(BEARINGS + 1e-9), np.cos(BEARINGS + 1e-9)
    across = np.where(east > 0, EAST, WEST) / east
    along = np.where(north > 0, NORTH, SOUTH) / north
    range_m = np.minimum(across, along)
    incidence = np.degrees(np.arccos(np.where(across < along, np.abs(east), np.abs(north))))
    points = range_m[:, None] * np.stack([east, north], axis=1)
    edges = np.array(rectangle(WEST, SOUTH, EAST, NORTH))
    return range_m, incidence, np.linalg.norm(points[:, None] - edges[None], axis=2).min(axis=1)


def wall_peaks(scan: Floats) -> tuple[Floats, Floats]:
    """Level in dB and place beside the true wall in m of each beam's greatest echo within 0.3 m of it."""
    level, offset = np.empty(200), np.empty(200)
    for i, range_m in enumerate(truth()[0]):
        low = int((range_m - 0.3) / BIN_M)
        best = low + int(scan[i, low : low + 48].argmax())
        level[i], offset[i] = scan[i, best] * DB, (best + 0.5) * BIN_M - range_m
    return level, offset


@pytest.mark.parametrize(("least", "most", "lowest_db", "highest_db"), [(0, 6, 47, 54), (25, 40, 40, 47)])
def test_wall_peaks_fall_with_incidence(
    scans: list[Floats], least: float, most: float, lowest_db: float, highest_db: float
) -> None:
    _, incidence, corner = truth()
    chosen = (incidence >= least) & (incidence < most) & (corner > 0.5)
    levels = np.concatenate([wall_peaks(scan)[0][chosen] for scan in scans])
    assert lowest_db <= np.median(levels) <= highest_db


def test_grazed_walls_are_faint_and_corners_loud(scans: list[Floats]) -> None:
    long = Site("long", (Wall(np.array(rectangle(-8, -1.6, 8, 1.6))),), floor_m=2.6, stops=(), material=ROCK)
    model = EchoModel(long, 1)
    levels = []
    for degrees in (47.0, 50.0, 53.0, 56.0, 127.0, 130.0, 230.0, 310.0):
        range_m = 1.6 / abs(np.cos(np.radians(degrees)))
        low = int((range_m - 0.3) / BIN_M)
        ping = model.ping(HERE, float(np.radians(degrees)), Sampling(BIN_M, 399), 0)
        levels.append(ping[low : low + 48].max() * DB)
    assert 33.0 <= np.median(levels) <= 43.0
    corner = truth()[2] < 0.05
    assert np.median([wall_peaks(scan)[0][corner].max() for scan in scans]) == pytest.approx(55.0, abs=4.0)


def test_peaks_scatter_more_where_walls_are_met_obliquely(scans: list[Floats]) -> None:
    _, incidence, corner = truth()
    offsets = np.array([wall_peaks(scan)[1] for scan in scans])
    square = offsets[:, (incidence < 15) & (corner > 0.5)]
    oblique = offsets[:, (incidence > 30) & (corner > 0.5)]
    assert 0.005 <= square.std() <= 0.035
    assert 1.3 * square.std() <= oblique.std() <= 0.13


def test_ringing_is_the_same_at_all_bearings_and_ends(scans: list[Floats]) -> None:
    inside = scans[0][:, 8:17] * DB
    assert 25.0 <= np.median(inside) <= 35.0
    assert np.median(inside, axis=1).std() < 1.5
    assert np.median(scans[0][:, 40:110]) == 0.0


def test_zero_band_then_a_floor_of_some_decibels() -> None:
    open_water = Site("sea", (Wall(np.array(rectangle(-40, -40, 40, 40))),), floor_m=60.0, stops=(), material=ROCK)
    deep = Place(0.0, 0.0, 30.0, 0.0)
    scan = circle(EchoModel(open_water, 2), deep) * DB
    assert (scan[:, 105:122] == 0.0).mean() > 0.97
    assert 5.0 <= np.median(scan[:, 130:390]) <= 9.0


def test_side_lobes_draw_rings_at_the_range_of_a_clear_wall() -> None:
    scene = Scene(Site("room", TANK.walls, floor_m=40.0, stops=(), material=TILE), 4)
    view = View(0.0, 0.0, 20.0, BIN_M, 399)
    ring = slice(int(NORTH / BIN_M), int(NORTH / BIN_M) + 3)
    peak = max(scene.power(view, np.radians(off))[ring].max() for off in (-1.0, 0.0, 1.0))
    for off in (14.0, 20.0):
        beside = np.mean([scene.power(view, np.radians(sign * off))[ring].mean() for sign in (1, -1)])
        assert -27.0 <= 10 * np.log10(beside / peak) <= -9.0


def test_second_bounces_stand_at_twice_the_range_and_at_range_plus_width() -> None:
    room = Site("room", TANK.walls, floor_m=40.0, stops=(), material=TILE)
    beams = [Scene(room, seed).power(View(0.0, 0.0, 20.0, 0.02, 400), 0.0) for seed in range(9)]
    power = np.median(10 * np.log10(np.array(beams) + 1e-9), axis=0)

    def level(range_m: float) -> float:
        at = int(range_m / 0.02)
        return float(power[at - 2 : at + 14].max())

    wall = level(NORTH)
    assert -38.0 <= level(2 * NORTH) - wall <= -15.0
    assert -17.0 <= level(NORTH + (NORTH - SOUTH)) - wall <= -6.0
    assert np.median(power[int(5.2 / 0.02) : int(6.0 / 0.02)]) < wall - 35.0


def test_floor_answers_from_where_the_beam_meets_it() -> None:
    wide = Site("wide", (Wall(np.array(rectangle(-30, -30, 30, 30))),), floor_m=2.6, stops=(), material=ROCK)
    scene = Scene(wide, 1)
    onsets = []
    for above_m in (0.3, 0.6, 1.2):
        power = 10 * np.log10(scene.power(View(0.0, 0.0, 2.6 - above_m, 0.025, 400), 0.3) + 1e-9)
        assert power[:240].max() > 15.0
        onsets.append(float(np.argmax(power > 12.0)) * 0.025 / above_m)
    # 35 degrees of height reach down at h / sin(17.5) = 3.3 h; the beam's skirts begin somewhat earlier.
    assert all(1.0 <= onset <= 3.3 for onset in onsets)


def test_speckle_has_the_measured_correlations() -> None:
    speckle = Speckle(5)
    ranges = np.arange(960, dtype=np.float64) * STEP_M
    angles = np.radians(np.arange(0.0, 360.0, 1.8))
    field = np.array([speckle.along(0.02, 0.03, float(a), ranges) for a in angles])
    assert field.std() == pytest.approx(1.0, abs=0.06)

    def correlation(a: Floats, b: Floats) -> float:
        return float(np.corrcoef(a.ravel(), b.ravel())[0, 1])

    for lag, wanted in ((1, 0.6), (2, 0.4), (3, 0.3)):
        assert correlation(field, np.roll(field, lag, axis=0)) == pytest.approx(wanted, abs=0.07)
    for steps, wanted in ((2, 0.6), (4, 0.3), (6, 0.1)):
        assert correlation(field[:, steps:], field[:, :-steps]) == pytest.approx(wanted, abs=0.06)


def test_speckle_is_frozen_at_rest_and_changes_over_centimetres() -> None:
    model = EchoModel(TANK, 9)
    still = circle(model)
    behind = slice(150, 380)

    def alike(other: Floats) -> float:
        level = [each[:, behind] - np.median(each[:, behind], axis=0) for each in (still, other)]
        return float(np.corrcoef(level[0].ravel(), level[1].ravel())[0, 1])

    assert alike(circle(model, first=200)) > 0.97
    ranges = np.arange(100, dtype=np.float64) * BIN_M
    near, far = [], []
    for angle in np.linspace(0, 6, 40):
        here = model._speckle.along(0.5, 0.5, float(angle), ranges)
        near.append(np.corrcoef(here, model._speckle.along(0.503, 0.5, float(angle), ranges))[0, 1])
        far.append(np.corrcoef(here, model._speckle.along(0.62, 0.5, float(angle), ranges))[0, 1])
    assert np.mean(near) > 0.98
    assert abs(np.mean(far)) < 0.1


def test_echoes_do_not_depend_on_what_was_pinged_before() -> None:
    fresh, used = EchoModel(TANK, 9), EchoModel(TANK, 9)
    for i in range(30):
        used.ping(Place(0.01 * i, 0.0, 2.0, 0.0), 0.1 * i, Sampling(BIN_M, 399), i)
    sampling = Sampling(0.025, 400)
    assert np.array_equal(fresh.ping(HERE, 1.0, sampling, 7), used.ping(HERE, 1.0, sampling, 7))
    assert not np.array_equal(fresh.ping(HERE, 1.0, sampling, 7), EchoModel(TANK, 10).ping(HERE, 1.0, sampling, 7))


def test_gain_lifts_all_levels_alike() -> None:
    model = EchoModel(TANK, 9)
    quiet, loud = (model.ping(HERE, 0.0, Sampling(BIN_M, 399, gain), 1).astype(int) for gain in (40.0, 50.0))
    wall = slice(150, 175)
    assert np.median(loud[wall] - quiet[wall]) == pytest.approx(10 / DB, abs=1.0)


def test_levels_lie_where_a_real_head_in_a_tank_has_them(scans: list[Floats], shared_data: Path) -> None:
    with np.load(shared_data / "sonar" / "micron-tank-14scans.npz") as file:
        real = file["intensity"].reshape(14, 200, 399).astype(np.float64)
    ours = np.array(scans)
    for low_m, high_m in ((0.08, 0.24), (1.6, 1.8), (2.0, 3.0), (3.0, 4.4)):
        bins = slice(int(low_m / BIN_M), int(high_m / BIN_M))
        for share in (50, 75, 90):
            difference = np.percentile(ours[:, :, bins], share) - np.percentile(real[:, :, bins], share)
            assert abs(difference) * DB <= 6.0, f"{low_m} to {high_m} m, {share} % of the echoes"


def test_rays_meet_walls_where_geometry_says() -> None:
    segments = Segments.of(TANK.walls)
    angles = np.radians([0.0, 90.0, 45.0, 180.0])
    direct, bounced = trace(segments, np.zeros(2), angles, 1)
    assert direct.way_m == pytest.approx([NORTH, EAST, EAST * np.sqrt(2), -SOUTH], abs=1e-9)
    assert direct.cosine == pytest.approx([1.0, 1.0, np.sqrt(0.5), 1.0])
    # Unfolded, a bounce goes straight on into the mirrored room.
    assert bounced.way_m == pytest.approx([2 * NORTH - SOUTH, 2 * EAST - WEST, NORTH * np.sqrt(2), -2 * SOUTH + NORTH])
    outside = cast(segments, np.array([[50.0, 0.0]]), np.array([[1.0, 0.0]]))
    assert outside.way_m[0] == NOTHING_M
    assert len(corners(TANK.walls)) == 4


def test_a_bell_is_wider_below() -> None:
    site = SITES["bell"]()
    upper, lower = (Scene(site, 1).power(View(0.0, 0.0, depth, 0.02, 300), 3.0) for depth in (1.0, 2.6))
    assert int(lower.argmax()) > int(upper.argmax()) + 20
