"""The bench of hole filling: damage that can be judged, and verdicts that are right."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from config.errors import InputError
from mapping.values import FREE, OCCUPIED, UNKNOWN
from tools.bench.holes_causes import causes
from tools.bench.holes_damage import damage
from tools.bench.holes_figures import figures, trust
from tools.bench.holes_gates import find_gates, shut
from tools.bench.holes_judge import LossVerdict, Proposal, judge
from tools.bench.holes_loss import Damaged, Loss
from tools.bench.holes_maps import PRIOR_SAW, Source, pieces, read_state, sounded, sources
from tools.bench.holes_methods import METHODS
from tools.bench.holes_pictures import draw
from tools.bench.holes_table import line
from tools.bench.holes_walk import centre_lines

State = NDArray[np.uint8]


@pytest.fixture(scope="module")
def site() -> State:
    """Four chambers in rock with a door between each two, and a pillar."""
    state = np.full((160, 200), UNKNOWN, np.uint8)
    state[8:152, 8:192] = OCCUPIED
    for rows in (slice(11, 78), slice(81, 149)):
        for cols in (slice(11, 98), slice(101, 189)):
            state[rows, cols] = FREE
    for rows, cols in (
        (slice(40, 52), slice(98, 101)),
        (slice(108, 120), slice(98, 101)),
        (slice(78, 81), slice(50, 60)),
    ):
        state[rows, cols] = FREE
    state[30:36, 40:46] = OCCUPIED
    return state


@pytest.fixture(scope="module")
def damaged(site: State) -> Damaged:
    return damage("site", site, np.random.default_rng(4))


def certain(filled: NDArray[np.bool_], value: float) -> Proposal:
    return Proposal(filled, np.where(filled, value, 0.0).astype(np.float32))


def test_damage_takes_of_every_kind_and_only_away(site: State, damaged: Damaged) -> None:
    kinds = {loss.kind for loss in damaged.losses}
    assert kinds == {"stretch", "shadow", "opening seen", "opening unseen"}
    changed = damaged.seen != site
    assert changed.any()
    assert np.all(damaged.seen[changed] == UNKNOWN)
    for loss in damaged.losses:
        rows, cols = loss.line.T
        if loss.opening:
            assert np.all(damaged.truth[rows, cols] == FREE)
        else:
            assert 3 <= loss.gap <= 40
            assert np.all(damaged.truth[rows, cols] == OCCUPIED)
            assert np.all(damaged.seen[rows, cols] == UNKNOWN)


def test_the_same_seed_does_the_same_damage_and_another_does_not(site: State, damaged: Damaged) -> None:
    again = damage("site", site, np.random.default_rng(4))
    assert again.seen.tobytes() == damaged.seen.tobytes()
    assert again.owner.tobytes() == damaged.owner.tobytes()
    assert damage("site", site, np.random.default_rng(5)).seen.tobytes() != damaged.seen.tobytes()


def test_a_perfect_filler_is_perfect(damaged: Damaged) -> None:
    lost = (damaged.truth == OCCUPIED) & (damaged.seen != OCCUPIED)
    found = figures([judge(damaged, certain(lost, 1.0))], np.random.default_rng(1))
    assert {found[key] for key in ("P", "R", "F1", "holes_right", "F1_low", "holes_right_high")} == {1.0}
    assert {found[key] for key in ("walled_seen", "walled_unseen", "far_per_lost", "ece")} == {0.0}


def test_a_filler_that_walls_everything_up_is_bad(damaged: Damaged) -> None:
    everything = damaged.seen != OCCUPIED
    found = figures([judge(damaged, certain(everything, 1.0))], np.random.default_rng(1))
    assert found["R"] == 1.0
    assert found["P"] < 0.2
    assert found["holes_right"] == 0.0
    assert found["walled_seen"] == found["walled_unseen"] == 1.0
    assert found["brier_skill"] < 0.0
    assert found["ece"] > 0.5
    assert found["over_water_per_lost"] > 10.0


def test_a_filler_that_does_nothing_has_found_nothing_and_walled_nothing(damaged: Damaged) -> None:
    nothing = Proposal(np.zeros(damaged.seen.shape, bool), None)
    found = figures([judge(damaged, nothing)], np.random.default_rng(1))
    assert found["R"] == found["F1"] == found["holes_right"] == found["walled_seen"] == 0.0
    assert math.isnan(found["P"])
    assert math.isnan(found["brier_skill"])
    assert found["left_open"] == 1.0


def test_a_fill_beside_the_wall_is_wrong(damaged: Damaged) -> None:
    lost = (damaged.truth == OCCUPIED) & (damaged.seen != OCCUPIED)
    found = figures([judge(damaged, certain(np.roll(lost, (9, 9), (0, 1)), 0.9))], np.random.default_rng(1))
    assert found["holes_right"] < 0.3
    assert found["P"] < 0.5


def test_openings_are_found_and_told_shut_from_open(site: State) -> None:
    gates = [gate for gate in find_gates(site, centre_lines(site == OCCUPIED)) if gate.gap < 18]
    doors = np.array([(46, 99), (79, 55), (114, 99)])
    away = np.array([np.abs(doors - (gate.row, gate.col)).max(axis=1) for gate in gates])
    assert np.all(away.min(axis=0) <= 2)
    assert np.all(away.min(axis=1) <= 2)
    gate = gates[[abs(gate.row - 79) <= 1 for gate in gates].index(True)]
    solid = site != FREE
    assert not shut(gate.banks, solid)
    walled = solid.copy()
    walled[79, 49:61] = True
    assert shut(gate.banks, walled)
    walled[79, 55] = False
    assert not shut(gate.banks, walled)


def verdict(right: list[bool], told: float) -> LossVerdict:
    loss = Loss("stretch", np.zeros((4, 2), np.int64), 4.0, np.zeros((0, 3), np.int64))
    return LossVerdict(loss, np.array(right), np.full(len(right), told), 4, 4, False)


def test_trust_is_measured_against_the_base_rate() -> None:
    honest = trust([verdict([True] * 9 + [False], 0.9), verdict([True] + [False] * 9, 0.1)])
    assert honest["ece"] == pytest.approx(0.1, abs=0.11)
    assert honest["brier_skill"] == pytest.approx(1 - 0.09 / 0.25)
    boastful = trust([verdict([True] * 5 + [False] * 5, 1.0)])
    assert boastful["brier_skill"] == pytest.approx(-1.0)
    assert boastful["ece"] >= 0.5


@pytest.mark.parametrize("name", list(METHODS))
def test_every_method_fills_a_plain_gap_in_a_wall_along_x(name: str) -> None:
    state = np.full((60, 80), UNKNOWN, np.uint8)
    state[10:50, 10:70] = OCCUPIED
    state[12:48, 12:68] = FREE
    state[10:12, 38:41] = UNKNOWN
    before = state.copy()
    filled = METHODS[name](state).filled
    assert np.array_equal(state, before)
    assert filled[10:12, 38:41].any(axis=0).all()
    empty = METHODS[name](np.full((30, 30), UNKNOWN, np.uint8))
    assert not empty.filled.any()


def test_rock_deeper_than_a_sonar_tells_of_is_forgotten() -> None:
    state = np.full((40, 40), OCCUPIED, np.uint8)
    state[20:, :] = FREE
    known = sounded(state)
    assert np.all(known[17:20] == OCCUPIED)
    assert np.all(known[:17] == UNKNOWN)
    assert np.all(known[20:] == FREE)


def test_halves_hang_on_the_name_alone_and_the_prior_saw_none_of_the_report_half() -> None:
    assert {Source(name, Path(f"{name}.yaml")).half for name in PRIOR_SAW} == {"tune"}
    halves = [Source(f"map {number}", Path("x")).half for number in range(200)]
    assert 60 < halves.count("report") < 140


def test_an_absent_folder_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="--data"):
        sources(tmp_path / "nowhere", "report")


def test_real_maps_are_cut_into_pieces(shared_data: Path) -> None:
    found = sources(shared_data, "report")
    assert not {each.name for each in found} & PRIOR_SAW
    for source in (found[0], next(each for each in found if each.path.suffix == ".npz")):
        for piece in pieces(read_state(source.path), 2, np.random.default_rng(1)):
            assert max(piece.shape) <= 240
            assert set(np.unique(piece)) <= {UNKNOWN, FREE, OCCUPIED}


def test_a_picture_shows_both(damaged: Damaged, tmp_path: Path) -> None:
    lost = (damaged.truth == OCCUPIED) & (damaged.seen != OCCUPIED)
    draw(tmp_path / "new" / "site.png", damaged, certain(lost, 1.0))
    with Image.open(tmp_path / "new" / "site.png") as image:
        assert image.size == ((2 * 200 + 2) * 4, 160 * 4)


def test_the_table_leaves_blank_what_was_not_measured() -> None:
    assert "legend" not in line({"method": "ours", "P": 0.5})
    assert line({"method": "ours", "P": 0.5}).split()[:3] == ["ours", "0.50", "-"]
    assert "WARNING" in line({"half": "tune", "WARNING": "flattered"})


def test_every_hole_has_one_cause_and_a_plain_gap_is_closed_right() -> None:
    state = np.full((60, 120), UNKNOWN, np.uint8)
    state[20:23, 5:115] = OCCUPIED
    state[23:55, 5:115] = FREE
    seen = state.copy()
    seen[18:26, 50:58] = UNKNOWN
    line_there = np.stack([np.full(8, 21), np.arange(50, 58)], axis=1)
    owner = np.zeros(state.shape, np.int32)
    lost = Loss("stretch", line_there, 8.0, np.zeros((0, 3), np.int64))
    assert causes(Damaged("plain", state, seen, (lost,), owner)) == [(8.0, "closed right")]
    seen[15:30, 30:100] = FREE  # no way may cross the water
    assert causes(Damaged("wet", state, seen, (lost,), owner)) == [(8.0, "no way drawn")]
