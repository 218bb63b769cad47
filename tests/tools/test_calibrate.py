"""Speed of sound and range offset from a pool of known size."""

from __future__ import annotations

import json
import tomllib
from pathlib import Path

import numpy as np
import pytest

from config.errors import DataError, UsageError
from config.schema import Config, Sonar
from tools.calibrate import Calibration, calibrate, scans_of, sides_of, text
from tools.cli import main
from tools.emulator.dive import Dive, DiveOptions
from tools.emulator.record import record, write_jsonl
from tools.emulator.site import SITES

POOL_M = (8.0, 5.0)
TRUE_SPEED_M_S = 1440.0


@pytest.fixture(scope="module")
def pool_log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two rests in the emulated pool, in colder water than the configuration believes."""
    folder = tmp_path_factory.mktemp("pool")
    dive = Dive(SITES["pool"](), 3, DiveOptions(stations=2, sound_speed_m_s=TRUE_SPEED_M_S))
    write_jsonl(record(dive), folder / "pool.jsonl")
    assert main(["import", str(folder / "pool.jsonl"), "-o", str(folder / "pool.mcap")]) == 0
    return folder / "pool.mcap"


def test_a_pool_comes_out_right_after_calibration(pool_log: Path, capsys: pytest.CaptureFixture[str]) -> None:
    capsys.readouterr()
    assert main(["calibrate", str(pool_log), "--room", "5x8"]) == 0
    told = tomllib.loads(capsys.readouterr().out)
    wrong = Config()
    speed_m_s = told["sonar"]["sound_speed_m_s"]
    right = Config(sonar=Sonar(sound_speed_m_s=speed_m_s))
    before = np.array([sides for scan in scans_of([pool_log], wrong) if (sides := sides_of(scan, wrong))])
    after = np.array([sides for scan in scans_of([pool_log], right) if (sides := sides_of(scan, right))])
    assert len(before) == len(after) == 2
    assert np.median(before[:, 0]) - POOL_M[0] > 0.15
    corrected = np.median(after, axis=0) + 2.0 * told["map"]["range_offset_m"]
    assert corrected == pytest.approx(POOL_M, abs=0.03)
    assert speed_m_s == pytest.approx(TRUE_SPEED_M_S, abs=12.0)


def test_figures_come_with_how_sure_they_are(pool_log: Path, capsys: pytest.CaptureFixture[str]) -> None:
    capsys.readouterr()
    assert main(["calibrate", str(pool_log), "--room", "8x5", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["circles"] == 2
    assert 0.5 < told["sound_speed_sd_m_s"] < 15.0
    assert abs(told["sound_speed_m_s"] - TRUE_SPEED_M_S) < 3.0 * told["sound_speed_sd_m_s"]
    assert max(told["off_m"]) < 0.03


def test_the_circle_that_is_off_most_is_told() -> None:
    read = np.array([[8.0, 5.0], [8.0, 5.0], [8.0, 5.0], [8.0, 5.05], [7.97, 5.0]])
    assert calibrate(read, (8.0, 5.0), 1481.0).off_m == pytest.approx((0.03, 0.05), abs=0.002)


def test_scale_and_offset_are_told_apart_by_a_long_room_and_not_by_a_square_one() -> None:
    truth = np.array([8.0, 3.0])
    read = np.tile((truth - 2.0 * -0.05) / 0.98, (5, 1))
    long = calibrate(read, (8.0, 3.0), 1500.0)
    assert long.sound_speed_m_s == pytest.approx(1470.0, abs=4.0)
    assert long.range_offset_m == pytest.approx(-0.05, abs=0.012)
    square = calibrate(np.tile((4.0 + 0.1) / 0.98, (5, 2)), (4.0, 4.0), 1500.0)
    assert square.sound_speed_sd_m_s > 3.0 * long.sound_speed_sd_m_s
    assert square.range_offset_sd_m > 2.0 * long.range_offset_sd_m


def test_a_room_of_another_size_is_refused(pool_log: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["calibrate", str(pool_log), "--room", "6x5"]) == DataError.exit_code
    assert "measure it again" in capsys.readouterr().err
    assert main(["calibrate", str(pool_log), "--room", "big"]) == UsageError.exit_code


def test_the_lines_are_toml() -> None:
    lines = text(Calibration(3, 1450.2, 4.0, -0.0121, 0.005, (8.11, 5.07), (0.012, 0.021)), (5.0, 8.0))
    assert tomllib.loads(lines) == {"sonar": {"sound_speed_m_s": 1450.2}, "map": {"range_offset_m": -0.0121}}
    assert lines.startswith(
        "# 3 circles: 8 x 5 m read 8.11 x 5.07 m\n# then no circle is off by more than 1.2 x 2.1 cm\n"
    )
