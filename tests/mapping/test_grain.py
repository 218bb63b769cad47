from __future__ import annotations

import numpy as np
import pytest

from mapping.grain import ALIKE, Grain, grain_of, levels, pull
from mapping.likeness import Likeness
from mapping.path import HERE, THERE, Floats, Marks, inertia
from mapping.pattern import Pattern
from mapping.progress import Passage, Progress

KNOTS, SECONDS, GONE_M, HALF_M = 31, 15.0, 2.4, 0.9
LINE = Passage(np.array([1.0, 0.0]), 0.0, 0.0)


def true_path() -> Floats:
    when = np.clip(np.linspace(-0.3, 1.3, KNOTS), 0.0, 1.0)
    path = np.zeros((KNOTS + 2, 3))
    path[1:-1, 0] = GONE_M * when**3 * (10.0 - 15.0 * when + 6.0 * when**2)
    path[-1, 0] = GONE_M
    return path


def texture(xy_m: Floats, rng: np.random.Generator) -> Floats:
    """Levels of 8 units about 100 that stay with a wall, alike over a hand's breadth."""
    turn = rng.normal(0.0, 1.0 / 0.11, (200, 2))
    waves = np.cos(xy_m @ turn.T + rng.uniform(0.0, 2.0 * np.pi, 200)).sum(axis=1)
    return np.asarray(100.0 + 8.0 * waves / 10.0)


def heard(rng: np.random.Generator, share: float) -> tuple[Marks, Floats]:
    """Looks along a smooth tunnel from both rests and under way; ``share`` of what differs is the walls' own."""
    path, angles = true_path(), np.radians(np.arange(0.0, 360.0, 1.8) + 0.3)
    rests = [
        (np.full(200, state), np.zeros(200), np.full(200, group)) for state, group in ((0, HERE), (KNOTS + 1, THERE))
    ]
    at = np.linspace(0.0, KNOTS - 1 - 1e-6, 400)
    moving = (at.astype(np.intp) + 1, at % 1.0, np.arange(400) // 100 + 1)
    state, share_of, group = (np.concatenate(each) for each in zip(*rests, moving, strict=True))
    angle = np.resize(angles, len(state))
    met = np.abs(np.cos(angle)) > 0.2
    angle, state, share_of, group = (each[met] for each in (angle, state, share_of, group))
    across = np.cos(angle)
    range_m = HALF_M / np.abs(across)
    arm = np.stack([range_m * np.sin(angle), range_m * across], axis=1)
    n = len(angle)
    marks = Marks(arm, np.ones(n), np.full(n, np.nan), state.astype(np.intp), share_of, group.astype(np.intp))
    places, _ = marks.places(path)
    own = texture(places, rng) - 100.0
    level = 60.0 + 40.0 * np.abs(across) - 5.0 * np.log(range_m)
    return marks, level + np.sqrt(share) * own + np.sqrt(1.0 - share) * rng.normal(0.0, 6.0, len(own))


def grain(share: float = 0.7) -> Grain:
    told = grain_of(*heard(np.random.default_rng(5), share))
    assert told is not None
    return told


def test_levels_are_means_about_the_return() -> None:
    echoes = np.zeros((2, 40), np.uint8)
    echoes[:, 18:23] = 100
    assert levels(echoes, np.array([20.5 * 0.025, 0.01]), 0.025) == pytest.approx([100.0, 0.0])


def test_what_levels_owe_to_incidence_is_taken_off() -> None:
    told = grain()
    arm = told.marks.arm_m
    incidence = np.abs(arm[:, 1]) / np.hypot(arm[:, 0], arm[:, 1])
    assert abs(np.corrcoef(incidence, told.level)[0, 1]) < 0.05
    assert told.level.std() == pytest.approx(1.0)
    assert incidence.min() > 0.25, "what is met too flat is left out"
    assert np.isfinite(told.marks.normal_rad).all()


def test_walls_that_are_all_equally_loud_have_no_grain() -> None:
    marks, level = heard(np.random.default_rng(5), 0.7)
    assert grain_of(marks, np.full(len(level), 80.0)) is None
    few = Marks(
        marks.arm_m[:10],
        marks.trust[:10],
        marks.normal_rad[:10],
        marks.state[:10],
        marks.share[:10],
        marks.group[:10],
    )
    assert grain_of(few, level[:10]) is None


def test_walls_sound_alike_along_the_path_that_was_gone_only() -> None:
    likeness, path = Likeness(grain()), true_path()
    still, long = path * 0.0, path * [1.3, 1.0, 1.0]
    assert likeness.of(path) > 15.0
    assert max(likeness.of(still), likeness.of(long)) < likeness.of(path) - 15.0


def test_walls_without_a_grain_of_their_own_sound_alike_along_no_path() -> None:
    likeness = Likeness(grain(0.0))
    assert all(likeness.of(true_path() * [share, 1.0, 1.0]) < 5.0 for share in (0.0, 0.5, 0.9, 1.0, 1.1))


def test_looks_draw_a_path_to_where_others_heard_their_like() -> None:
    told, prior = grain(), inertia(SECONDS, KNOTS, 0.0)
    prior[1::3, 1::3] += np.eye(KNOTS + 2) * 1e4  # the walls hold it across
    prior[2::3, 2::3] += np.eye(KNOTS + 2) * 1e6
    path = true_path() * [0.96, 1.0, 1.0]
    for _ in range(6):
        more, by = pull(told, path)
        step = np.zeros(path.size)
        step[3:] = np.linalg.solve((prior + more)[3:, 3:], (prior @ path.ravel() + by)[3:])
        path = path - step.reshape(path.shape)
    assert abs(path[-1, 0] - GONE_M) < 0.03


def test_a_pattern_tells_how_loud_a_wall_is_along_it() -> None:
    told = grain()
    pattern = Pattern(told, HERE)
    of = (told.marks.group == HERE) & (np.abs(told.marks.arm_m[:, 0]) < 0.5)
    arm, level = told.marks.arm_m[of].astype(np.float32), told.level[of].astype(np.float32)
    right = pattern.odds(level, arm[:, 0], arm[:, 1])
    assert right.mean() > 0.1
    assert pattern.odds(level, arm[:, 0] + np.float32(0.5), arm[:, 1]).mean() < right.mean() - 0.2
    assert pattern.odds(level, arm[:, 0], arm[:, 1] - np.float32(9.0)).tolist() == [0.0] * len(level)
    assert right.max() <= -0.5 * np.log(1.0 - ALIKE**2) + 4.0


def test_progress_is_followed_to_the_right_distance() -> None:
    way = Progress(grain(), LINE, 4.2, KNOTS, SECONDS)
    best = int(way.height.argmax())
    assert way.far_m[best] == pytest.approx(GONE_M, abs=0.11)
    gone = way.best(best)
    true = true_path()[1:-1, 0]
    assert np.abs(np.interp(np.linspace(0, 1, KNOTS), np.linspace(0, 1, len(gone)), gone) - true).mean() < 0.08
    back = Progress(grain(), LINE.back, 4.2, KNOTS, SECONDS)
    assert back.height.max() < way.height.max() - 3.0


def test_a_passage_is_the_same_line_both_ways() -> None:
    line = Passage(np.array([0.6, 0.8]), 0.05, -0.04)
    far = np.array([0.5, 2.0])
    assert line.back.at(far) == pytest.approx(line.at(-far))
