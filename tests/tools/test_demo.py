from __future__ import annotations

import json
from pathlib import Path

import pytest

from drivers.log import log_files
from tools.cli import main


def test_a_headless_dive_leaves_log_and_results(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "out"
    assert main(["demo", "--headless", "--stations", "1", "--speed", "10", "--json", "--out", str(out)]) == 0
    report = json.loads(capsys.readouterr().out)
    assert report == json.loads((out / "report.json").read_text())
    assert report["live"] == {"equal": True, "finished": True, "sha256": report["sha256"]}
    assert sum(report["stations"].values()) == 1
    logs = log_files([out])
    assert [path.name for path in logs] == report["logs"]
    assert main(["replay", str(out), "-o", str(tmp_path / "again")]) == 0
    for name in ("map.pgm", "filled.pgm", "poses.csv", "mesh.ply", "plan.png"):
        assert (out / name).read_bytes() == (tmp_path / "again" / name).read_bytes()


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["--headless"], "needs --out DIR"),
        (["--speed", "0"], "--speed must be from"),
        (["--speed", "nan"], "--speed must be from"),
        (["--stations", "0"], "--stations must be 1 or more"),
        (["--site", "atlantis"], "invalid choice"),
    ],
)
def test_wrong_usage_is_one_line(words: list[str], says: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["demo", *words]) == 64
    error = capsys.readouterr().err
    assert says in error
    assert error.count("\n") == 1
