"""Errors and ellipses of an emulated dive's map, as `lacuna bench truth` judges them."""

from __future__ import annotations

import numpy as np
import pytest

from mapping.values import Pose, Scan, Station
from tools.bench.align import angle_between
from tools.bench.truth import Errors, closure_m, errors_of
from tools.emulator.dive import Dive
from tools.emulator.site import SITES
from tools.emulator.vehicle import Rest

TURN = 0.3


def station(pose: Pose, covariance: np.ndarray) -> Station:
    scan = Scan(0, 0, 1, 0.0, 1.0, np.zeros(5), np.zeros((5, 16), np.uint8), 0.02, 0.03, "full")
    return Station(scan, pose, covariance, "placed", 0, 9.0, "")


def found(off_m: np.ndarray, sd_m: tuple[float, float]) -> Errors:
    """Stations of the tunnel, off by so much in true axes, in a map whose axes are turned, as its compass is."""
    dive = Dive(SITES["tunnel"](), 1)
    c, s = np.cos(TURN), np.sin(TURN)
    to_map = np.array([[c, s], [-s, c]])  # of rows: a map turned counter-clockwise by TURN
    covariance = np.zeros((3, 3))
    covariance[:2, :2] = to_map.T @ np.diag(np.square(sd_m)) @ to_map
    pairs = []
    for k, (stop, off) in enumerate(zip(dive.site.stops, off_m, strict=True)):
        x_m, y_m = (np.array([stop.x_m, stop.y_m]) + off) @ to_map
        pose = Pose(float(x_m), float(y_m), (stop.heading_rad - TURN) % (2.0 * np.pi))
        pairs.append((station(pose, covariance), Rest(k, stop, 0, 1)))
    errors, alignment = errors_of(dive, pairs)
    assert angle_between(TURN, alignment.clockwise_rad) == pytest.approx(0.0, abs=0.02)
    return errors


def test_a_map_turned_as_its_compass_is_has_no_errors() -> None:
    errors = found(np.zeros((9, 2)), (0.1, 0.1))
    assert np.abs(errors.fitted_m).max() < 1e-9
    assert errors.heading_rad.max() < 1e-9
    assert errors.covered == 1.0


def test_an_ellipse_along_the_tunnel_covers_what_a_round_one_does_not() -> None:
    slid = np.zeros((9, 2))
    slid[:, 0] = 0.1 * np.arange(9)
    long, round_ = found(slid, (0.5, 0.05)), found(slid, (0.05, 0.05))
    assert long.covered == 1.0
    assert round_.covered == pytest.approx(1 / 8)
    assert long.sd_m.max() == pytest.approx(0.5)
    assert long.across_m.max() < 0.4 * np.sin(np.radians(6.0))  # the stops lie a little beside the middle
    assert np.linalg.norm(long.fitted_m, axis=1).max() == pytest.approx(0.4, abs=0.01)


def test_errors_across_the_tunnel_are_told_as_such() -> None:
    beside = np.zeros((9, 2))
    beside[4, 1] = 0.2
    assert found(beside, (0.1, 0.1)).across_m.max() == pytest.approx(0.2 * 8 / 9, abs=0.01)


def test_errors_along_the_tunnel_are_told_about_the_origin_and_the_gap_from_the_first_rest_to_the_last() -> None:
    slid = np.zeros((9, 2))
    slid[:, 0] = 0.1 * np.arange(9)
    errors = found(slid, (0.5, 0.05))
    assert errors.along_m[0] == 0.0
    assert errors.along_m.max() == pytest.approx(0.8, abs=0.02)
    assert closure_m(errors, list(range(9)), 9) == pytest.approx(0.8, abs=0.02)
    assert np.isnan(closure_m(errors, list(range(9)), 12))
