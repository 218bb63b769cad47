"""What the benches judge with must itself be right."""

from __future__ import annotations

import numpy as np
import pytest

from config.errors import UsageError
from tools.bench.align import align, angle_between
from tools.bench.rectangle import fit_rectangle
from tools.bench.walls import distance_to_walls_m, in_view, sampled
from tools.cli import main

SQUARE = (np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0]]), True)


@pytest.mark.parametrize("turn_deg", [0.0, 13.0, 44.0, 61.0, 89.0])
def test_a_turned_room_with_clutter_is_fitted(turn_deg: float) -> None:
    rng = np.random.default_rng(3)
    along = rng.uniform(0, 1, 400)
    walls = [
        np.stack([4.6 * along[:100], np.zeros(100)], axis=1),
        np.stack([np.full(100, 4.6), 4.4 * along[100:200]], axis=1),
        np.stack([4.6 * along[200:300], np.full(100, 4.4)], axis=1),
        np.stack([np.zeros(100), 4.4 * along[300:]], axis=1),
    ]
    points = np.concatenate([*walls, rng.uniform(0.5, 3.9, (40, 2))])
    turn = np.radians(turn_deg)
    turned = points @ np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    room = fit_rectangle(turned)
    assert room is not None
    assert sorted(room.sides_m) == pytest.approx([4.4, 4.6], abs=0.02)
    assert np.mean(room.distance_m(turned) < 0.01) == pytest.approx(400 / 440, abs=0.02)


def test_too_few_points_are_no_room() -> None:
    assert fit_rectangle(np.zeros((7, 2))) is None


def test_alignment_undoes_a_clockwise_turn_and_a_shift() -> None:
    true = np.array([[0.0, 0.0], [3.0, 1.0], [2.0, -4.0]])
    turn = 0.3
    # A point north of the origin, turned clockwise, lies to the east.
    found = (true - [1.0, 2.0]) @ np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    alignment = align(found, true, 0.0)
    assert alignment.clockwise_rad == pytest.approx(turn)
    assert alignment.apply(found) == pytest.approx(true)
    assert align(np.zeros((1, 2)), np.array([[0.0, 1.0]]), 0.5).apply(np.array([[0.0, 1.0]])) == pytest.approx(
        np.array([[np.sin(0.5), 1 + np.cos(0.5)]])
    )


def test_angles_wrap() -> None:
    assert angle_between(np.radians(350), np.radians(10)) == pytest.approx(np.radians(20))


def test_distance_to_walls() -> None:
    points = np.array([[2.0, 1.0], [5.0, 2.0], [-3.0, -4.0]])
    assert distance_to_walls_m(points, [SQUARE]) == pytest.approx([1.0, 1.0, 5.0])


def test_a_wall_behind_a_wall_is_not_in_view() -> None:
    screen = (np.array([[1.0, 1.0], [3.0, 1.0]]), False)
    points_m = sampled([SQUARE, screen])
    seen = points_m[in_view(points_m, [SQUARE, screen], np.array([2.0, 3.0]), 10.0)]
    south = seen[np.isclose(seen[:, 1], 0.0)]
    assert len(seen) > 200
    assert np.all((south[:, 0] < 0.51) | (south[:, 0] > 3.49))
    assert not in_view(sampled([SQUARE]), [SQUARE], np.array([2.0, 2.0]), 1.0).any()


def test_an_unknown_bench_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["bench", "nonsense"]) == UsageError.exit_code
    assert "tank" in capsys.readouterr().err
