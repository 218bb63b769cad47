"""Ends of walls: where they are, which way they point, and where there are none."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from fill.logistic import Logistic
from fill.segments import find_walls


def blank() -> NDArray[np.bool_]:
    return np.zeros((60, 60), bool)


@pytest.mark.parametrize("thick", [1, 2, 3, 5, 7])
def test_a_straight_wall_ends_in_its_middle_at_both_faces(thick: int) -> None:
    mask = blank()
    mask[20 : 20 + thick, 10:50] = True
    ends = find_walls(mask).ends
    assert len(ends) == 2
    middle = 20 + (thick - 1) / 2
    for end, x, dx in zip(sorted(ends, key=lambda each: each.x), (10, 49), (-1, 1), strict=True):
        assert end.x == pytest.approx(x, abs=1.6)
        assert end.y == pytest.approx(middle, abs=0.8)
        assert end.dx == pytest.approx(dx, abs=0.03)


def test_rings_and_blobs_have_no_end() -> None:
    mask = blank()
    rows, cols = np.ogrid[:60, :60]
    away = np.hypot(rows - 30, cols - 30)
    mask[(away < 20) & (away > 17)] = True
    mask[28:33, 28:33] = True
    mask[5, 5] = True
    assert find_walls(mask).ends == ()


def test_every_branch_keeps_its_end() -> None:
    mask = blank()
    mask[29:32, 5:55] = True
    mask[5:30, 29:32] = True
    assert len(find_walls(mask).ends) == 3


def test_a_bent_wall_ends_in_the_direction_it_has_there() -> None:
    mask = blank()
    rows, cols = np.ogrid[:60, :60]
    away = np.hypot(rows - 5, cols - 5)
    mask[(np.abs(away - 40) <= 1.5) & (cols > 12) & (rows > 12)] = True
    for end in find_walls(mask).ends:
        tangent = math.atan2(end.y - 5, end.x - 5) + math.pi / 2
        turn = math.atan2(end.dy, end.dx) - tangent
        assert abs(math.sin(turn)) < math.sin(math.radians(9))


@pytest.mark.parametrize("limb", [3, 5])
def test_a_wall_cut_off_just_after_a_corner_ends_as_its_short_limb_does(limb: int) -> None:
    mask = blank()
    mask[10:40, 30] = True
    mask[40, 30 : 31 + limb] = True
    end = max(find_walls(mask).ends, key=lambda each: each.y)
    assert (end.x, end.y) == pytest.approx((30 + limb, 40), abs=1.0)
    assert abs(math.atan2(end.dy, end.dx)) < math.radians(20)


def test_solid_ground_is_not_a_wall() -> None:
    mask = np.ones((60, 60), bool)
    mask[20:40, 20:40] = False
    walls = find_walls(mask)
    assert walls.ends == ()
    assert not walls.mask[0, 0]


def test_a_model_moves_towards_what_it_is_taught_and_no_further_than_the_evidence() -> None:
    prior = Logistic(np.array([0.0, 1.0]), np.diag([1.0, 1.0]))
    features = np.column_stack([np.ones(40), np.zeros(40)])
    taught = prior.taught(features, np.ones(40), np.ones(40))
    once = prior.taught(features[:1], np.ones(1), np.ones(1))
    assert 0.5 < float(once.chance(features[:1])[0]) < float(taught.chance(features[:1])[0]) < 1.0
    assert taught.weights[1] == pytest.approx(1.0)
