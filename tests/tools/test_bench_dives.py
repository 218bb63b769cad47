"""Recorded dives with truth beside them, as `lacuna bench truth --dives` reads them."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from config.errors import DataError, InputError
from tools.bench.dives import Dome, measure, read_truth
from tools.bench.walls import distance_to_walls_m
from tools.emulator.site import Wall

SQUARE = Wall(np.array([[-2.0, -2.0], [2.0, -2.0], [2.0, 2.0], [-2.0, 2.0]]))


def test_a_dome_narrows_towards_its_top() -> None:
    dome = Dome("dome", (SQUARE,), (), 4.0, (0.0, 0.0), top=0.5, power=0.5)
    assert dome.plan_at(4.0)[0].points_m == pytest.approx(SQUARE.points_m)
    assert dome.plan_at(0.0)[0].points_m == pytest.approx(0.5 * SQUARE.points_m)
    assert dome.plan_at(1.0)[0].points_m == pytest.approx(0.75 * SQUARE.points_m)
    assert dome.plan_at(9.0)[0].points_m == pytest.approx(SQUARE.points_m)


def test_walls_without_taper_stand_upright() -> None:
    assert Dome("pool", (SQUARE,), (), 2.0).plan_at(0.3)[0].points_m == pytest.approx(SQUARE.points_m)


@pytest.mark.parametrize("site", ["pool", "bell"])
def test_the_walls_stand_at_the_first_rest_as_the_truth_draws_them_there(shared_data: Path, site: str) -> None:
    path = shared_data / "dives" / f"{site}.truth.json"
    dive = read_truth(path)
    first = dive.place_during(dive.rests[0])
    drawn = np.array(json.loads(path.read_text())["walls"][0])
    lines = [(wall.points_m, wall.closed) for wall in dive.site.plan_at(first.depth_m)]
    assert distance_to_walls_m(drawn[0] if drawn.ndim == 3 else drawn, lines).max() < 0.02
    assert [rest.index for rest in dive.rests] == list(range(len(dive.site.stops)))
    assert all(rest.to_ns is not None and rest.from_ns < rest.to_ns for rest in dive.rests)


def test_a_folder_without_dives_and_a_dive_without_truth_are_told(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no dive"):
        list(measure(tmp_path))
    (tmp_path / "x.jsonl.gz").write_bytes(b"")
    with pytest.raises(InputError, match="no truth"):
        list(measure(tmp_path))


@pytest.mark.parametrize("text", ["{", "[]", "{}", '{"stations": [{"x": 1}]}'])
def test_a_broken_truth_is_told_in_one_line(tmp_path: Path, text: str) -> None:
    path = tmp_path / "x.truth.json"
    path.write_text(text)
    with pytest.raises(DataError, match="no truth of a dive") as told:
        read_truth(path)
    assert "\n" not in str(told.value)
