"""``lacuna fill``: from a map to its files, on made and on real maps."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from mapping.values import FREE, OCCUPIED, UNKNOWN, Grid
from tools.cli import main
from tools.maps import read_map, state_shades, write_map


@pytest.fixture
def gap(tmp_path: Path) -> Path:
    """Return a map of a room with a gap of ten cells in one wall."""
    state = np.full((70, 90), UNKNOWN, np.uint8)
    state[10:60, 10:80] = OCCUPIED
    state[13:57, 13:77] = FREE
    state[10:13, 40:50] = UNKNOWN
    write_map(tmp_path, "gap", Grid(0.05, 1.0, -1.0, np.zeros(state.shape, np.float32), state), state_shades(state))
    return tmp_path / "gap.yaml"


def test_a_gap_is_filled_and_told(gap: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["fill", str(gap), "-o", str(tmp_path / "out")]) == 0
    assert "1 holes filled" in capsys.readouterr().out
    filled = read_map(tmp_path / "out" / "filled.yaml").grid
    assert np.all(filled.state[10:13, 40:50] == OCCUPIED)
    assert (filled.x0_m, filled.y0_m) == (1.0, -1.0)


def test_noise_is_told_once(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    state = np.full((160, 160), UNKNOWN, np.uint8)
    state[4:-4, 4] = OCCUPIED
    for spine in range(8, 152, 12):  # combs, all joined: more tips than a wall has
        state[spine, 4:-4] = OCCUPIED
        state[spine - 4 : spine + 5, 7:-4:3] = OCCUPIED
    grid = Grid(0.05, 0.0, 0.0, np.zeros(state.shape, np.float32), state)
    write_map(tmp_path, "combs", grid, state_shades(state))
    assert main(["fill", str(tmp_path / "combs.yaml"), "-o", str(tmp_path / "out")]) == 0
    said = [line for line in capsys.readouterr().out.splitlines() if "they are noise" in line]
    told = json.loads((tmp_path / "out" / "report.json").read_text())["fills"]
    assert told["noise_ends"] > 0
    assert [f"{told['noise_ends']} ends more" in line for line in said] == [True]


def test_json_is_the_report(gap: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["fill", str(gap), "-o", str(tmp_path / "out"), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told == json.loads((tmp_path / "out" / "report.json").read_text())
    assert told["site"] == "gap"
    assert told["fills"]["cells"] == 30


@pytest.mark.parametrize(
    ("words", "code"),
    [(["fill", "none.yaml", "-o", "out"], 66), (["fill", "bad.yaml", "-o", "out"], 65), (["fill", "bad.yaml"], 64)],
)
def test_wrong_input_is_one_line_and_an_exit_code(
    words: list[str],
    code: int,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    (tmp_path / "bad.yaml").write_text("resolution: 0.05\n")
    monkeypatch.chdir(tmp_path)
    assert main(words) == code
    told = capsys.readouterr().err
    assert told.count("\n") == 1
    assert told.startswith("lacuna: ")


def test_a_real_map_keeps_its_evidence(shared_data: Path, tmp_path: Path) -> None:
    source = shared_data / "maps" / "akhilj95+nunbot" / "nav2_map_labtech.yaml"
    assert main(["fill", str(source), "-o", str(tmp_path)]) == 0
    measured, filled = read_map(source).grid.state, read_map(tmp_path / "filled.yaml").grid.state
    changed = measured != filled
    assert changed.any()
    assert np.all(measured[changed] == UNKNOWN)
    assert np.all(filled[changed] == OCCUPIED)
