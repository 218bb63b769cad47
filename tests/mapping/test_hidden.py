"""Rays that pass a wall which other scans show tell nothing behind it."""

from __future__ import annotations

import numpy as np

from config.schema import Map
from mapping.grid import Cells, gather
from mapping.hidden import seen_by
from mapping.values import Pose

CELL_M = 0.05
POSE = Pose(0.0, 0.0, 0.0)


def rays(length: int, half_width_rad: float = 0.1) -> Cells:
    """Open water to the north, so many cells far, within an angle."""
    col, row = (each.ravel() for each in np.meshgrid(np.arange(-30, 31), np.arange(0, length)))
    inside = np.abs(np.arctan2(col + 0.5, row + 0.5)) < half_width_rad
    return Cells(row[inside].astype(np.int32), col[inside].astype(np.int32), np.full(inside.sum(), -0.9, np.float32))


def wall(row: int, gap: tuple[int, int] = (0, 0)) -> Cells:
    """A wall across, without the columns of the gap."""
    col = np.array([k for k in range(-30, 30) if not gap[0] <= k < gap[1]], np.int32)
    return Cells(np.full(len(col), row, np.int32), col, np.full(len(col), 3.0, np.float32))


def seen(*scans: Cells) -> Cells:
    return seen_by([POSE] * len(scans), scans, gather(scans, Map(cell_m=CELL_M)))[-1]


def test_behind_a_wall_of_two_others_a_ray_tells_nothing() -> None:
    kept = seen(wall(20), wall(20), rays(60))
    assert kept.row.max() <= 20
    assert len(kept.row) == (rays(60).row < 20).sum()


def test_through_an_opening_all_is_seen() -> None:
    far = rays(60)
    kept = seen(wall(20, gap=(-8, 8)), wall(20, gap=(-8, 8)), far)
    np.testing.assert_array_equal(kept.row, far.row)


def test_between_two_rays_that_a_wall_ends_nothing_is_seen_either() -> None:
    kept = seen(wall(20, gap=(0, 1)), wall(20, gap=(0, 1)), rays(60))
    assert kept.row.max() <= 20


def test_a_wall_that_most_rays_denied_hides_nothing() -> None:
    far = rays(60)
    kept = seen(wall(20), *[rays(60)] * 4, far)
    np.testing.assert_array_equal(kept.row, far.row)


def test_who_sees_a_wall_little_farther_off_keeps_it() -> None:
    near, far = rays(23), wall(23)
    own = Cells(*(np.concatenate([getattr(near, k), getattr(far, k)]) for k in ("row", "col", "log_odds")))
    kept = seen(wall(20), wall(20), own)
    np.testing.assert_array_equal(kept.row, own.row)


def test_rays_are_told_apart_all_around() -> None:
    for turns in range(4):
        ghost, true = turned(rays(60), turns), turned(wall(20), turns)
        kept = seen(true, true, ghost)
        assert np.hypot(kept.row, kept.col).max() < 24
        assert len(kept.row) == (rays(60).row < 20).sum()


def turned(cells: Cells, turns: int) -> Cells:
    """Turn cells by so many quarters of a turn about the corner of the first."""
    row, col = cells.row, cells.col
    for _ in range(turns):
        row, col = -col - 1, row
    return Cells(row, col, cells.log_odds)
