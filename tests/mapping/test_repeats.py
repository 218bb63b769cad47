"""Frozen speckle, seen again from the same place, is no second witness."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from config.schema import Map
from mapping.mapper import Mapper
from mapping.repeats import Repeats, same_grain
from mapping.values import Pose, Scan
from tools.emulator.echoes import EchoModel, Place, Sampling
from tools.emulator.site import SITES

STEP_RAD = math.radians(1.8)
BIN_M = 0.025
HERE = Pose(0.0, 0.0, 0.0)


def circle(index: int, x_m: float = -1.2, heading_rad: float = 0.0) -> Scan:
    """A circle in the house's cistern; speckle hangs on the place, noise on the ping's number."""
    model = EchoModel(SITES["house"](), 7)
    bearing = STEP_RAD * np.arange(200, dtype=np.float64)
    place, sampling = Place(x_m, -0.5, 1.0, heading_rad), Sampling(BIN_M, 240)
    echoes = np.stack([model.ping(place, float(b), sampling, 1000 * index + i) for i, b in enumerate(bearing)])
    return Scan(index, index, index + 1, heading_rad, 1.0, bearing, echoes, BIN_M, STEP_RAD, "full")


@pytest.fixture(scope="module")
def first() -> Scan:
    return circle(0)


def test_a_second_turn_at_the_same_place_adds_nothing(first: Scan) -> None:
    again = circle(1)
    assert same_grain(first, again, 0.0)
    alone, both = Mapper(Map()), Mapper(Map())
    alone.step(first)
    both.step(first)
    assert both.step(again).status == "placed"
    np.testing.assert_array_equal(both.grid.log_odds, alone.grid.log_odds)
    np.testing.assert_array_equal(both.mixture().probability, alone.mixture().probability)


def test_a_few_centimetres_on_the_grain_is_new(first: Scan) -> None:
    drifted = circle(1, x_m=-1.2 + 0.06)
    assert not same_grain(first, drifted, 0.0)
    alone, both = Mapper(Map()), Mapper(Map())
    alone.step(first)
    both.step(first)
    both.step(drifted)
    assert both.grid.log_odds.max() > 1.2 * alone.grid.log_odds.max()


def test_the_fuller_of_two_turns_draws(first: Scan) -> None:
    part = replace(first, index=1, bearing_rad=first.bearing_rad[:90], echoes=first.echoes[:90], quality="partial")
    assert Repeats().fresh([(HERE, part), (HERE, first)]) == [1]
    assert Repeats().fresh([(HERE, first), (HERE, part)]) == [0]
    assert Repeats().fresh([(HERE, first), (Pose(0.5, 0.0, 0.0), part)]) == [0, 1]
    assert Repeats().fresh([]) == []


def test_a_turn_of_the_vehicle_is_taken_out(first: Scan) -> None:
    turned = circle(1, heading_rad=4.0 * STEP_RAD)
    assert same_grain(first, turned, 4.0 * STEP_RAD)
    assert not same_grain(first, turned, 0.0)


def test_scans_with_other_bins_or_no_echo_are_no_repeats(first: Scan) -> None:
    assert not same_grain(first, replace(first, bin_m=0.05), 0.0)
    silent = replace(first, echoes=np.zeros_like(first.echoes))
    assert not same_grain(silent, silent, 0.0)
    nothing = replace(first, bearing_rad=np.zeros(0), echoes=np.zeros((0, 240), np.uint8))
    assert not same_grain(first, nothing, 0.0)
