"""A real tank, from a serial capture to the map: one rectangular room, and neither ringing nor ghosts."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tools.bench.tank import judge_tank, map_tank


@pytest.mark.parametrize("circles", [1, 14])
def test_the_real_tank_is_one_rectangular_room(shared_data: Path, tmp_path: Path, circles: int) -> None:
    grid = map_tank(shared_data / "sonar" / "micron-tank-14scans.npz", tmp_path, circles)
    figures = judge_tank(grid, circles)
    assert sorted((figures.side_a_m, figures.side_b_m)) == pytest.approx([4.4, 4.6], abs=0.1)
    assert figures.share_near_walls > 0.85
    assert figures.share_outside < 0.03
    report = json.loads((tmp_path / "map" / "report.json").read_text())
    assert report["stations"] == {"placed": 1}
    assert (tmp_path / "map" / "plan.png").stat().st_size > 10_000
