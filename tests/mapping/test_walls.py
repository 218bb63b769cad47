from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from config.schema import Map
from mapping.between import Frame, Seen, continued_m, expected_m, faint_behind, firm, peak_near, sides, veils
from mapping.clutter import deaf_m, lobe_weights, smoothed, without_ringing
from mapping.echoes import beams_of, in_order, of_lobes
from mapping.lean import Line, late_m, nearer_m
from mapping.lines import Fit, fit_walls
from mapping.mirror import Heard, images
from mapping.peaks import CENTRE_M, TAIL_M, centre_m, longer_m
from mapping.values import Scan
from tests.mapping.rooms import RECTANGLE, STEP_RAD, cast

BIN_M = 0.02
BEARING = np.arange(200.0, dtype=np.float64) * np.float64(STEP_RAD)
TRUE_M = np.array([cast(RECTANGLE, 0.0, 0.0, float(b))[0] for b in BEARING])


def fitted(range_m: NDArray[np.float64], sd_m: float = 0.03) -> Fit:
    return fit_walls(BEARING, range_m, np.full(200, sd_m), STEP_RAD, closed=True)


@given(seed=st.integers(0, 1000))
@settings(max_examples=10, deadline=None)
def test_neighbours_together_know_their_wall_better_than_each_alone(seed: int) -> None:
    noise_m = np.random.default_rng(seed).normal(0.0, 0.03, 200)
    fit = fitted(TRUE_M + noise_m)
    along = TRUE_M < 3.2
    assert np.std((fit.range_m - TRUE_M)[along]) < 0.85 * np.std(noise_m[along])
    assert np.mean(np.abs(fit.range_m - TRUE_M) < 3.0 * fit.sd_m) > 0.9


def test_a_straight_wall_stays_straight_up_to_its_corner() -> None:
    fit = fitted(TRUE_M)
    assert np.isfinite(fit.range_m).mean() > 0.95
    assert np.nanmax(np.abs(fit.range_m - TRUE_M)) < 0.035
    south = np.abs(BEARING - math.pi) < math.radians(20.0)
    assert 1.0 / np.hypot(*fit.wall[south].T) == pytest.approx(3.0, abs=1e-6)


def test_silent_beams_have_no_wall_and_spoil_none() -> None:
    range_m = np.where(np.arange(200) % 3 == 0, np.nan, TRUE_M)
    fit = fitted(range_m)
    assert np.isnan(fit.range_m[::3]).all()
    known = np.isfinite(fit.range_m)
    assert known.sum() > 100
    assert np.abs(fit.range_m - TRUE_M)[known].max() < 0.05
    assert np.isnan(fitted(np.full(200, np.nan)).range_m).all()


def test_the_line_of_the_walls_beside_a_silent_beam_is_expected_there() -> None:
    sure = np.ones(200, dtype=bool)
    sure[60:70] = False
    expected = expected_m(BEARING, fitted(TRUE_M).wall, sure, STEP_RAD, closed=True)
    assert expected[60:70] == pytest.approx(TRUE_M[60:70], abs=0.05)
    assert np.isnan(expected_m(BEARING, np.full((200, 2), np.nan), ~sure & False, STEP_RAD, closed=True)).all()


def test_sides_of_a_sector_do_not_reach_over_its_ends() -> None:
    sure = np.array([False, True, False, False, True, False])
    before, after = sides(sure, 2, closed=False)
    np.testing.assert_array_equal(before, [-1, 1, 1, 1, 4, 4])
    np.testing.assert_array_equal(after, [1, 1, 4, 4, 4, -1])
    np.testing.assert_array_equal(sides(sure, 2, closed=True)[0], [4, 1, 1, 1, 4, 4])


def test_a_faint_glimpse_behind_the_walls_is_none_and_a_clear_one_is() -> None:
    range_m, level = TRUE_M.copy(), np.full(200, 100.0)
    range_m[98:103] += 2.0
    sure, wall = np.ones(200, dtype=bool), fitted(TRUE_M).wall
    clear = faint_behind(Seen(BEARING, range_m, level), sure, wall, STEP_RAD, closed=True)
    assert not clear.any()
    level[98:103] = 40.0
    faint = faint_behind(Seen(BEARING, range_m, level), sure, wall, STEP_RAD, closed=True)
    np.testing.assert_array_equal(np.flatnonzero(faint), np.arange(98, 103))


def room_echoes(level: float = 100.0) -> np.ndarray:
    echoes = np.zeros((200, 500))
    echoes[np.arange(200), (TRUE_M / BIN_M).astype(int)] = level
    return echoes


def test_what_stands_before_a_wall_without_hiding_it_is_passed() -> None:
    echoes = room_echoes()
    echoes[98:102, 60] = 90.0
    bins = echoes.argmax(axis=1)
    bins[98:102] = 60
    weights = veils(echoes, bins, BIN_M, STEP_RAD)
    assert (weights[98:102, 60] == 0.0).all()
    assert (weights[98:102, bins[97] - 5 :] == 1.0).all()
    assert (weights[:98] == 1.0).all()
    echoes[98:102, 70:] = 0.0  # a body throws a shadow
    assert (veils(echoes, bins, BIN_M, STEP_RAD) == 1.0).all()


def test_a_mirror_image_of_the_room_is_none() -> None:
    fit = fitted(TRUE_M)
    range_m = TRUE_M.copy()
    ghost = slice(108, 116)  # seen past the south wall: the west wall's image, which goes straight on
    range_m[ghost] = -2.0 / np.sin(BEARING[ghost])
    echoes = room_echoes()
    told = images(BEARING, range_m, fit.wall, np.ones(200, dtype=bool), Heard(echoes, BIN_M, 0.0))
    np.testing.assert_array_equal(np.flatnonzero(told), np.arange(108, 116))
    silent = np.zeros_like(echoes)
    assert not images(BEARING, range_m, fit.wall, np.ones(200, dtype=bool), Heard(silent, BIN_M, 0.0)).any()
    hidden = images(BEARING, range_m, fit.wall, np.ones(200, dtype=bool), Heard(silent, BIN_M, 9.0))
    assert hidden[ghost].all()
    assert not images(BEARING, range_m, fit.wall, np.zeros(200, dtype=bool), Heard(echoes, BIN_M, 0.0)).any()


def test_a_wall_within_the_ringing_stands_out_of_it() -> None:
    rng = np.random.default_rng(1)
    echoes = np.clip(rng.normal(20.0, 5.0, (200, 400)), 0, 255)
    echoes[:, :30] = 100.0 + rng.normal(0.0, 3.0, (200, 30))
    echoes[:80, 9:11] = 165.0  # 0.2 m away, nearer than the least range, over two fifths of the circle
    clear = without_ringing(echoes, BIN_M, 0.3)
    assert clear[:80, 9:11].min() > 150.0
    assert clear[80:, :28].max() == 0.0
    assert deaf_m(echoes, BIN_M) == pytest.approx(0.6)
    assert smoothed(clear, BIN_M)[:80, 9:11].min() > 120.0


def test_the_side_lobe_of_a_clear_wall_counts_less_and_the_wall_itself_in_full() -> None:
    smooth = np.full((200, 300), 20.0)
    smooth[50, 100] = 150.0
    smooth[[44, 56], 100] = 90.0
    smooth[[44, 56], 200] = 90.0
    weights = lobe_weights(smooth, STEP_RAD, closed=True)
    assert weights[44, 100] == weights[56, 100] == 0.5
    assert weights[50, 100] == weights[44, 200] == weights[56, 200] == 1.0
    assert lobe_weights(smooth[:60], STEP_RAD, closed=False).shape == (60, 300)


def test_rings_that_a_pillars_side_lobes_explain_are_told_and_pillar_and_walls_are_not() -> None:
    echoes = np.full((200, 300), 10, np.uint8)
    echoes[48:53, 100:104] = 200  # a pillar without anything behind it
    echoes[[44, 56], 100:104] = 130
    echoes[100, 100:104] = 130  # and a wall elsewhere
    scan = Scan(0, 0, 1, 0.0, 1.0, BEARING, echoes, BIN_M, STEP_RAD, "full")
    beams = beams_of(scan, *in_order(scan)[:1], Map(), closed=True)
    assert of_lobes(beams, np.full(200, 101))[[44, 50, 56, 100]].tolist() == [True, False, True, False]


@given(range_m=st.floats(0.5, 7.0))
@settings(max_examples=25, deadline=None)
def test_the_centre_of_an_echo_is_where_its_power_is(range_m: float) -> None:
    bins_m = (np.arange(450) + 0.5) * BIN_M
    level = np.maximum(120.0 - 0.5 * 32.0 / 10.0 * ((bins_m - range_m) / 0.02) ** 2, 0.0)[None, :]
    centre = centre_m(level, np.zeros(450), level.argmax(axis=1), BIN_M)
    assert centre[0] == pytest.approx(range_m, abs=0.002)


def test_echoes_read_long_by_the_beams_height_but_no_more_than_the_window_takes_in() -> None:
    longer = longer_m(np.array([0.5, 2.0, 5.0, 50.0]), math.radians(17.5))
    assert (np.diff(longer) > 0.0).all()
    assert longer[0] - TAIL_M == pytest.approx(0.004, abs=0.002)
    assert longer[-1] < TAIL_M + CENTRE_M / 3.0
    assert longer_m(np.array([3.0]), 1e-3)[0] == pytest.approx(TAIL_M, abs=1e-4)


def test_the_peak_nearest_to_an_expected_place_is_taken() -> None:
    excess = np.zeros((3, 300))
    excess[0, [100, 106]] = 50.0
    excess[1, 140] = 50.0
    at = peak_near(excess, np.array([2.01, 2.0, np.nan]), BIN_M)
    np.testing.assert_array_equal(at, [100, -1, -1])


def leaning_echoes(lean: float, range_m: float = 2.0) -> np.ndarray:
    """Echoes of a round well, in counts, whose wall recedes by ``lean`` for each metre of depth."""
    elevation = np.radians(np.linspace(-26.0, 26.0, 400))
    met_m = range_m / (np.cos(elevation) - lean * np.sin(elevation))
    facing = (np.cos(elevation) - lean * np.sin(elevation)) / math.hypot(1.0, lean)
    lobe = 0.75 * np.exp(-((np.degrees(np.arccos(np.minimum(facing, 1.0))) / 14.0) ** 2)) + 0.25 * facing**1.5
    beam = 10.0 ** (-0.6 * (np.degrees(elevation) / 17.5) ** 2)
    power, _ = np.histogram(met_m, np.arange(401) * BIN_M, weights=lobe * beam)
    level = 150.0 + 31.875 * np.log10(np.maximum(power / power.max(), 1e-6))
    speckle = np.random.default_rng(4).normal(0.0, 12.0, (200, 400))
    echoes: np.ndarray = np.maximum(np.maximum(level, 0.0) + speckle, 15.0)
    return echoes


def centres(echoes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Ranges of the first strong peaks' centres, without and with the lean that the echoes tell."""
    floor, half_beam, half_height = np.full(400, 15.0), math.radians(1.5), math.radians(17.5)
    at = (echoes > 130.0).argmax(axis=1)
    plain = centre_m(echoes, floor, at, BIN_M)
    plain -= longer_m(plain, half_height)
    line = Line(plain, np.ones(200, dtype=bool), np.zeros(200))
    late = late_m(echoes, floor, BIN_M, line, half_beam)
    centre = centre_m(echoes, floor, at, BIN_M, late)
    return plain, centre - longer_m(centre, half_height, late) + nearer_m(line, late)


@pytest.mark.parametrize("lean", [0.35, 0.46, -0.46])
def test_the_wall_of_a_well_is_measured_at_the_sonars_own_level(lean: float) -> None:
    plain, leaning = centres(leaning_echoes(lean))
    assert np.median(plain) < 1.93
    assert np.median(leaning) == pytest.approx(2.0, abs=0.05)


def test_an_upright_wall_does_not_lean() -> None:
    plain, leaning = centres(leaning_echoes(0.0))
    assert np.median(plain) == pytest.approx(2.0, abs=0.02)
    np.testing.assert_array_equal(plain, leaning)


def test_a_wall_goes_on_into_its_corner_where_there_is_an_echo() -> None:
    sure = np.abs(np.diff(TRUE_M, append=TRUE_M[0])) < 1.0
    corner = int(TRUE_M.argmax())
    sure[corner - 2 : corner + 1] = False
    seen = Seen(BEARING, np.where(sure, TRUE_M, TRUE_M + 0.08), np.full(200, 100.0))
    frame = Frame(BIN_M, STEP_RAD, True, np.zeros(200))
    on = continued_m(seen, room_echoes(), sure, fitted(TRUE_M).wall, frame)
    told = np.isfinite(on)
    assert told.sum() >= 2
    assert not (told & sure).any()
    assert on[told] == pytest.approx(TRUE_M[told], abs=0.06)
    elsewhere = Seen(BEARING, np.where(sure, TRUE_M, TRUE_M + 1.0), np.full(200, 100.0))
    assert np.isnan(continued_m(elsewhere, room_echoes(), sure, fitted(TRUE_M).wall, frame)).all()
    assert np.isnan(continued_m(seen, np.zeros((200, 500)), sure, fitted(TRUE_M).wall, frame)).all()


def test_a_flash_beside_a_corner_is_no_firm_wall() -> None:
    range_m, sure = TRUE_M.copy(), np.ones(200, dtype=bool)
    range_m[100] -= 0.3
    fit = fitted(range_m)
    wall = fit.wall.copy()
    wall[100] *= TRUE_M[100] / range_m[100]
    told = firm(Seen(BEARING, range_m, np.full(200, 100.0)), sure, wall, closed=True)
    assert not told[100]
    assert told.mean() > 0.9
