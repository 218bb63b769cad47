from __future__ import annotations

import math

import numpy as np
import pytest

from config.schema import Map
from mapping.beam import polar_evidence
from mapping.ensemble import DRAWS, draw, mix
from mapping.grid import Cells, cells_of, render
from mapping.values import OCCUPIED, Grid, Pose, Returns, Scan
from tests.mapping.rooms import RECTANGLE, cast

POSES = [Pose(0.0, 0.0, 0.3), Pose(2.0, 0.5, 1.0)]


def placed_in_room() -> tuple[Grid, list[tuple[Pose, Cells]]]:
    """Two stations in a rectangle and the map that they make."""
    bearing = np.radians(np.arange(0.0, 360.0, 1.8))
    placed = []
    for k, pose in enumerate(POSES):
        range_m = np.array([cast(RECTANGLE, pose.x_m, pose.y_m, pose.heading_rad + b)[0] for b in bearing])
        returns = Returns(range_m, np.full(200, 0.03), range_m)
        echoes = np.zeros((200, 1), np.uint8)
        scan = Scan(k, k, k, pose.heading_rad, math.nan, bearing, echoes, 0.02, math.radians(1.8), "full")
        placed.append((pose, polar_evidence(scan, returns, math.radians(3.0), 0.05)))
    return render(placed, Map()), [(pose, cells_of(pose, evidence, 0.05)) for pose, evidence in placed]


def spread(sd_m: float, sd_rad: float) -> np.ndarray:
    """Covariance of two stations of which the first is held."""
    covariance = np.zeros((6, 6))
    covariance[3:, 3:] = np.diag([sd_m**2, sd_m**2, sd_rad**2])
    return covariance


def test_draws_have_the_covariance_they_are_drawn_from_and_the_best_pose_as_mean() -> None:
    rng = np.random.default_rng(1)
    a = rng.normal(0.0, 1.0, (6, 6))
    off = np.concatenate([draw(a @ a.T, rng) for _ in range(200)]).reshape(-1, 6)
    assert off.mean(axis=0) == pytest.approx(np.zeros(6), abs=1e-9)
    assert off.T @ off / len(off) == pytest.approx(a @ a.T, rel=0.3, abs=0.5)


def test_sure_poses_leave_the_map_as_it_is() -> None:
    grid, placed = placed_in_room()
    mixture = mix(grid, placed, np.zeros((DRAWS, 2, 3)))
    assert np.abs(mixture.probability - grid.probability).max() < 1e-6
    assert not mixture.sd_m.any()


def test_unsure_poses_make_walls_unsure_and_leave_no_hole() -> None:
    grid, placed = placed_in_room()
    walls = grid.state == OCCUPIED
    sure, unsure = (mix(grid, placed, draw(spread(sd, sd / 10.0), np.random.default_rng(1))) for sd in (0.005, 0.2))
    assert unsure.probability[walls].mean() < sure.probability[walls].mean() - 0.05
    assert np.count_nonzero(grid.state == OCCUPIED) == np.count_nonzero(walls)
    assert (unsure.sd_m[walls] > 0.0).mean() > 0.5
    assert not unsure.sd_m[~walls].any()
    assert 0.05 < np.median(unsure.sd_m[walls]) < 0.3


def test_a_far_wall_is_less_sure_than_a_near_one_where_the_heading_is_unsure() -> None:
    grid, placed = placed_in_room()
    mixture = mix(grid, placed[:1], draw(np.diag([0.0, 0.0, math.radians(2.0) ** 2]), np.random.default_rng(2)))
    row, col = np.nonzero(grid.state == OCCUPIED)
    x, y = grid.x0_m + (col + 0.5) * grid.cell_m, grid.y0_m + (row + 0.5) * grid.cell_m
    sd, away = mixture.sd_m[row, col], np.hypot(x, y)
    assert sd[away > 4.5].mean() > 1.5 * sd[(away < 3.0) & (sd > 0.0)].mean()


def test_the_same_seed_gives_the_same_bytes() -> None:
    grid, placed = placed_in_room()
    one, two = (mix(grid, placed, draw(spread(0.1, 0.01), np.random.default_rng(5))) for _ in range(2))
    assert one.probability.tobytes() == two.probability.tobytes()
    assert one.sd_m.tobytes() == two.sd_m.tobytes()


def test_nothing_is_mixed_of_nothing() -> None:
    empty = Grid(0.05, 0.0, 0.0, np.zeros((0, 0), np.float32), np.zeros((0, 0), np.uint8))
    assert mix(empty, [], np.zeros((DRAWS, 0, 3))).probability.shape == (0, 0)
