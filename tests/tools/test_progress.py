"""The line that says how far long work is."""

from __future__ import annotations

import io

import pytest

from tools import progress


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_counts_on_a_terminal_and_cleans_up(monkeypatch: pytest.MonkeyPatch) -> None:
    terminal = Terminal()
    monkeypatch.setattr("sys.stderr", terminal)
    monkeypatch.setattr(progress, "_LINE_S", 0.0)
    assert list(progress.counted(range(2500), "records")) == list(range(2500))
    assert terminal.getvalue() == "\r\x1b[Krecords: 0\r\x1b[Krecords: 1000\r\x1b[Krecords: 2000\r\x1b[K"


def test_says_nothing_elsewhere(capsys: pytest.CaptureFixture[str]) -> None:
    assert list(progress.counted("abc", "letters")) == ["a", "b", "c"]
    assert capsys.readouterr().err == ""
