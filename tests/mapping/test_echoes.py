from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from config.schema import Map
from mapping.contour import trace
from mapping.echoes import VAGUE_SD_M, in_order, pick
from mapping.values import Scan
from tests.mapping.rooms import BIN_M, BINS, KEYHOLE, RECTANGLE, STEP_RAD, cast, echoes_of


def scan_of(walls: np.ndarray, x_m: float = 0.0, y_m: float = 0.0, beams: int = 200, seed: int = 5) -> Scan:
    rng = np.random.default_rng(seed)
    bearing = np.arange(beams, dtype=np.float64) * STEP_RAD
    echoes = np.stack([echoes_of(*cast(walls, x_m, y_m, float(b)), rng) for b in bearing])
    return Scan(0, 0, 1, 0.0, math.nan, bearing, echoes, BIN_M, STEP_RAD, "full" if beams == 200 else "partial")


def truth_of(walls: np.ndarray, scan: Scan, x_m: float = 0.0, y_m: float = 0.0) -> np.ndarray:
    return np.array([cast(walls, x_m, y_m, float(b))[0] for b in scan.bearing_rad])


@pytest.mark.parametrize("walls", [RECTANGLE, KEYHOLE])
def test_walls_are_found_and_sure_ones_are_right(walls: np.ndarray) -> None:
    scan = scan_of(walls)
    returns, truth = pick(scan, Map()), truth_of(walls, scan)
    sure = returns.sd_m < VAGUE_SD_M
    assert sure.mean() > 0.6
    assert np.mean(np.abs(returns.range_m - truth)[sure] < 0.1) > 0.97


def test_no_water_is_told_open_behind_a_wall() -> None:
    for x_m, y_m in ((0.0, 0.0), (1.2, -1.0), (0.2, 3.0)):
        scan = scan_of(KEYHOLE, x_m, y_m)
        assert np.mean(pick(scan, Map()).free_m > truth_of(KEYHOLE, scan, x_m, y_m) + 0.15) < 0.02


def test_second_bounces_are_not_walls() -> None:
    scan = scan_of(RECTANGLE)
    echoes = scan.echoes.copy()
    for i, r in enumerate(truth_of(RECTANGLE, scan)):
        ghost = int((r + 0.9) / BIN_M)
        if ghost < BINS - 3:
            echoes[i, ghost : ghost + 3] = echoes[i].max()
    returns, truth = pick(replace(scan, echoes=echoes), Map()), truth_of(RECTANGLE, scan)
    answers = np.isfinite(returns.range_m)
    assert answers.mean() > 0.5
    assert np.mean(np.abs(returns.range_m - truth)[answers] < 0.2) > 0.95


def test_a_ring_at_all_bearings_is_no_wall() -> None:
    scan = scan_of(RECTANGLE)
    echoes = scan.echoes.copy()
    echoes[:, 50:54] = np.maximum(echoes[:, 50:54], 75)
    returns = pick(replace(scan, echoes=echoes), Map())
    assert np.mean(np.abs(returns.range_m - 1.04) < 0.1) < 0.03


def test_noise_alone_has_no_walls_and_no_open_water() -> None:
    rng = np.random.default_rng(2)
    echoes = np.clip(rng.normal(20.0, 6.0, (200, BINS)), 0, 255).astype(np.uint8)
    returns = pick(replace(scan_of(RECTANGLE), echoes=echoes), Map())
    assert np.isfinite(returns.range_m).mean() < 0.05
    assert (returns.free_m > 0.0).mean() < 0.2


@given(shift=st.integers(0, 199), reverse=st.booleans())
@settings(max_examples=12, deadline=None)
def test_where_the_circle_begins_and_which_way_it_turns_do_not_matter(shift: int, reverse: bool) -> None:
    scan = scan_of(KEYHOLE)
    way = np.roll(np.arange(200), shift)[:: -1 if reverse else 1]
    turned = replace(scan, bearing_rad=scan.bearing_rad[way] % (2.0 * math.pi), echoes=scan.echoes[way])
    np.testing.assert_array_equal(pick(turned, Map()).range_m, pick(scan, Map()).range_m[way])


def test_a_sector_is_not_closed_and_starts_at_its_end() -> None:
    scan = scan_of(RECTANGLE, beams=70)
    across = replace(scan, bearing_rad=(scan.bearing_rad - 1.0) % (2.0 * math.pi))
    order, closed = in_order(across)
    assert not closed
    np.testing.assert_array_equal(order, np.arange(70))
    assert np.isfinite(pick(across, Map()).range_m).any()


def test_tiny_scans_say_nothing() -> None:
    scan = scan_of(RECTANGLE, beams=3)
    returns = pick(scan, Map())
    assert np.isnan(returns.range_m).all()
    assert (returns.free_m == 0.0).all()
    none = replace(scan, bearing_rad=np.zeros(0), echoes=np.zeros((0, 400), np.uint8))
    assert len(pick(none, Map()).range_m) == 0


def test_the_range_offset_is_added() -> None:
    scan = scan_of(RECTANGLE)
    plain, moved = pick(scan, Map()), pick(scan, Map(range_offset_m=-0.1))
    np.testing.assert_allclose(moved.range_m, plain.range_m - 0.1)


def test_the_contour_prefers_the_unbroken_line_to_louder_specks() -> None:
    excess = np.zeros((60, 100))
    excess[:, 50] = 50.0
    excess[::7, 80] = 90.0
    contour = trace(excess, 0.02, STEP_RAD, closed=True)
    assert (contour.bins == 50).all()
    assert contour.joined.all()


def test_side_lobes_of_a_doorways_edges_do_not_shut_it() -> None:
    scan = scan_of(RECTANGLE)
    bearing = np.degrees(scan.bearing_rad)
    wall_m = np.where(np.abs(bearing - 180.0) < 25.0, 2.0, 2.6 + 0.6 * np.cos(2.0 * scan.bearing_rad + math.pi))
    within = np.maximum(18.0 - np.abs(bearing - 180.0), 0.0)  # degrees into a doorway, 36 degrees wide
    loud = 150.0 - np.where(within > 0.0, 40.0 + 1.0 * within, 0.0)
    behind = np.where(within > 0.0, 45.0, 0.0)
    bins = (np.arange(BINS) + 0.5) * BIN_M
    level = np.maximum(
        loud[:, None] - 7.0 * ((bins - wall_m[:, None]) / 0.06) ** 2, behind[:, None] - 7.0 * ((bins - 4.5) / 0.06) ** 2
    )
    noise = np.random.default_rng(3).normal(20.0, 6.0, (200, BINS))
    returns = pick(replace(scan, echoes=np.clip(np.maximum(level, noise), 0, 255).astype(np.uint8)), Map())
    sure = returns.sd_m < VAGUE_SD_M
    assert not (sure & (within > 12.0) & (np.abs(returns.range_m - 2.0) < 0.3)).any()
    assert np.mean(sure[within == 0.0]) > 0.8
