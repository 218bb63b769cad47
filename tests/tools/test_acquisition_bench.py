"""The acquisition keeps its promises: the essentials here, more of them in the slow test, all in ``lacuna bench``."""

from __future__ import annotations

import random
from pathlib import Path

import pytest

from tools.bench import acquisition, garbage, kills, line_faults, load, parser, ping_rate
from tools.bench.figure import Figure, at_least, at_most
from tools.bench.load import Source, pings, sentences
from tools.cli import main

TIMED = ("ready", "processor", "slowest", "ping to ping", "longest way back", "oldest byte", "faster")
"""Figures that a busy machine spoils: they are not judged here."""


def assert_kept(figures: list[Figure]) -> None:
    broken = [each for each in figures if not each.holds and not each.name.startswith(TIMED)]
    assert broken == []


def test_garbage_breaks_nothing(tmp_path: Path) -> None:
    figures = list(garbage.measure(tmp_path, 90_000))
    assert_kept(figures)
    assert {each.name.split(" (")[0] for each in figures} >= {
        "undamaged frames read beside 1 % damaged ones",
        "slowest garbage byte by byte",
    }


def test_faults_are_outlived(tmp_path: Path) -> None:
    figures = {each.name: each for each in line_faults.measure(tmp_path, 30)}
    assert_kept(list(figures.values()))
    assert figures["faults survived"].value >= 30


def test_kills_lose_nothing_false(tmp_path: Path) -> None:
    assert_kept(list(kills.measure(tmp_path, 2, 30)))


def test_reading_is_compared_where_there_is_something_to_compare_with() -> None:
    figures = list(parser.measure(40))
    assert figures[0].value > 0
    assert "bluerobotics-ping" in figures[1].name
    assert len(figures) in (2, 3)


@pytest.mark.slow
def test_more_of_everything(tmp_path: Path) -> None:
    for name in ("load", "rate", "garbage", "faults", "kills"):
        (tmp_path / name).mkdir()
    assert_kept(list(load.measure(tmp_path / "load", 4.0)))
    assert_kept(list(ping_rate.measure(tmp_path / "rate", 4.0)))
    assert_kept(list(garbage.measure(tmp_path / "garbage", 1_000_000)))
    assert_kept(list(line_faults.measure(tmp_path / "faults", 150)))
    assert_kept(list(kills.measure(tmp_path / "kills", 15, 100)))


def test_a_figure_says_whether_its_promise_holds() -> None:
    assert at_most("cost", 7.0, 6.0, "%").row() == {
        "figure": "cost",
        "value": 7.0,
        "unit": "%",
        "promise": "at most 6",
        "holds": "NO",
    }
    assert at_least("speed", 31.0, 30.0, "x").holds
    assert not at_least("speed", 29.0, 30.0, "x").holds
    assert "holds" not in Figure("size", 3.0, "m").row()


def test_a_broken_promise_is_the_exit_code(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    seen: list[acquisition.Extent] = []

    def measure(extent: acquisition.Extent) -> list[Figure]:
        seen.append(extent)
        return [at_most("cost", 7.0, limit, "%")]

    monkeypatch.setattr(acquisition, "measure", measure)
    limit = 6.0
    assert main(["bench", "acquisition", "--quick"]) == 1
    assert "broken promises: cost" in capsys.readouterr().err
    limit = 8.0
    assert main(["bench", "acquisition"]) == 0
    assert seen == [acquisition.QUICK, acquisition.FULL]


def test_a_kill_is_judged_by_the_first_missing_byte() -> None:
    life = kills.Life({"sonar": [(1.0, b"ab"), (2.0, b"cd"), (2.5, b"ef")]}, 3.0)
    assert life.oldest_loss_s("sonar", b"abcdef") == 0.0
    assert life.oldest_loss_s("sonar", b"abc") == 1.0
    assert life.oldest_loss_s("sonar", b"") == 2.0
    assert life.oldest_loss_s("sonar", b"abX") is None


def test_a_source_talks_at_the_pace_of_its_line() -> None:
    source = Source(sentences(1), 4800)
    said = [source.after(0.1) for _ in range(10)]
    assert {len(each) for each in said} == {48}
    assert b"".join(said).startswith(b"$")
    frames = pings(1)
    assert len(next(frames)) == 445
    frame = next(frames)
    assert garbage.damaged(random.Random(1), frame) != frame
