"""Faults by script: their files, their times, and what they make of bytes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from config.errors import DataError, InputError
from tools.cli import main
from tools.emulator.faults import Calendar, Fault, Spell, read_faults
from tools.emulator.faults.bytewise import doubled, dropped, flipped, misread
from tools.emulator.faults.line import FaultyLine
from tools.emulator.line import Line

MS = 1_000_000
S = 1000 * MS
BAUDS = [4800, 9600, 19200, 38400, 57600, 115200]


def rng() -> np.random.Generator:
    return np.random.default_rng(1)


def test_a_script_reads_the_same_as_toml_and_as_json_lines(tmp_path: Path) -> None:
    toml, lines = tmp_path / "faults.toml", tmp_path / "faults.jsonl"
    toml.write_text(
        '[[fault]]\nkind = "flip"\nport = "feed"\nevery_s = 20\nfor_s = 2.5\nrate = 0.1\n\n'
        '[[fault]]\nkind = "power_cut"\nat_s = 30\n'
    )
    lines.write_text(
        '{"kind":"flip","port":"feed","every_s":20,"for_s":2.5,"rate":0.1}\n\n{"kind":"power_cut","at_s":30}\n'
    )
    flip, cut = read_faults(toml)
    assert read_faults(lines) == (flip, cut)
    assert (flip.befalls, flip.lasts_s, flip.rate) == ("feed", 2.5, 0.1)
    assert (cut.befalls, cut.lasts_s) == ("sonar", 2.0)
    toml.write_text("")
    assert read_faults(toml) == ()


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ('[[fault]]\nkind = "flood"\nat_s = 1', "fault 1, kind: Input should be 'hangup'"),
        ('[[fault]]\nkind = "stall"\nat_s = 1', "stall needs a port: sonar or feed"),
        ('[[fault]]\nkind = "stall"\nport = "sonar"', "either at_s or every_s"),
        ('[[fault]]\nkind = "stall"\nport = "sonar"\nat_s = 1\nevery_s = 1', "either at_s or every_s"),
        ('[[fault]]\nkind = "stale"\nport = "sonar"\nat_s = 1', "stale does not befall the port sonar"),
        ('[[fault]]\nkind = "stall"\nport = "feed"\nat_s = 1\nrate = 0.5', "stall has no rate"),
        ('[[fault]]\nkind = "flip"\nport = "feed"\nat_s = 1\nrate = 2', "fault 1, rate: Input should be less"),
        ('[[fault]]\nkind = "flip"\nport = "feed"\nat_s = nan', "at_s: Input should be a finite number"),
        ('[[fault]]\nkind = "jump"\nat_s = 1\nheading = 3', "fault 1, heading: Extra inputs"),
        ("fault = 3", r"only \[\[fault\]\] tables"),
        ("[faults]", r"only \[\[fault\]\] tables"),
        ("kind =", "broken TOML"),
        ('{"kind": "stall"', "broken JSON"),
        ("{}\n[1]", "fault 1, kind: Field required"),
    ],
)
def test_a_wrong_script_is_one_line(tmp_path: Path, text: str, says: str) -> None:
    path = tmp_path / "faults"
    path.write_text(text)
    with pytest.raises(DataError, match=says) as caught:
        read_faults(path)
    assert "\n" not in str(caught.value)


def test_commands_refuse_scripts_that_are_absent_or_wrong(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(InputError, match="cannot read"):
        read_faults(tmp_path / "absent")
    assert main(["emulate", "--faults", str(tmp_path / "absent")]) == 66
    (tmp_path / "wrong").write_bytes(b"\xff\xfe")
    assert main(["demo", "--faults", str(tmp_path / "wrong")]) == 65
    assert "not UTF-8" in capsys.readouterr().err


def test_faults_come_at_their_times_and_are_told_once() -> None:
    faults = (Fault(kind="stall", port="feed", at_s=2.0), Fault(kind="clock_step", at_s=1.0, step_s=-60.0))
    calendar = Calendar(faults, 1)
    assert calendar.advance(50 * S) == [], "nothing before the start"
    calendar.start(100 * S)
    calendar.start(500 * S)
    assert calendar.advance(101 * S - 1) == []
    assert [spell.fault.kind for spell in calendar.advance(103 * S)] == ["clock_step", "stall"]
    assert calendar.utc_step_ns == -60 * S
    assert calendar.advance(1000 * S) == []


@settings(max_examples=30, deadline=None)
@given(st.lists(st.floats(0.1, 90.0), min_size=1, max_size=30), st.integers(0, 99))
def test_faults_that_repeat_do_not_depend_on_the_pace_of_asking(waits: list[float], seed: int) -> None:
    faults = (
        Fault(kind="stall", port="feed", every_s=20.0, for_s=3.0),
        Fault(kind="garbage", port="sonar", every_s=5.0),
        Fault(kind="drop", port="sonar", every_s=50.0),
    )
    one, other = Calendar(faults, seed), Calendar(faults, seed)
    one.start(0)
    other.start(0)
    times = [int(each * S) for each in np.cumsum(waits)]
    begun = [spell for t_ns in times for spell in one.advance(t_ns)]
    assert begun == other.advance(times[-1])
    assert [spell.from_ns for spell in begun] == sorted(spell.from_ns for spell in begun)
    stalls = [spell for spell in begun if spell.fault.kind == "stall"]
    assert all(spell.to_ns == spell.from_ns + 3 * S for spell in stalls)
    assert sum(spell.fault.kind == "drop" for spell in begun) <= 1, "one that stays comes once"


def test_faults_that_repeat_do_so_about_as_often_as_told() -> None:
    calendar = Calendar((Fault(kind="garbage", port="sonar", every_s=5.0),), 3)
    calendar.start(0)
    assert 160 <= len(calendar.advance(1000 * S)) <= 240


@given(st.binary(max_size=60))
def test_noise_at_its_most_and_its_least(data: bytes) -> None:
    assert dropped(data, 1.0, rng()) == b""
    assert doubled(data, 1.0, rng()) == bytes(each for byte in data for each in (byte, byte))
    assert [(a ^ b).bit_count() for a, b in zip(data, flipped(data, 1.0, rng()), strict=True)] == [1] * len(data)
    assert dropped(data, 1e-9, rng()) == doubled(data, 1e-9, rng()) == flipped(data, 1e-9, rng()) == data


def test_noise_comes_at_its_rate() -> None:
    data = bytes(20_000)
    assert len(dropped(data, 0.02, rng())) == pytest.approx(19_600, abs=60)
    assert len(doubled(data, 0.02, rng())) == pytest.approx(20_400, abs=60)
    assert sum(map(bool, flipped(data, 0.02, rng()))) == pytest.approx(400, abs=60)


@given(st.binary(max_size=40), st.sampled_from(BAUDS), st.floats(0.97, 1.03))
def test_rates_that_are_about_the_same_do_no_harm(data: bytes, baud: int, off: float) -> None:
    assert misread(data, baud, round(baud * off)) == data


def test_other_rates_read_what_a_receiver_would() -> None:
    # At twice the rate a receiver meets each bit of 0x55 twice: first the start bit's second half, then 1 1 0 0 1 1 0.
    assert misread(b"\x55", 9600, 19200) == b"\x66\xe6"
    assert misread(b"\x00", 9600, 115200) == b"\x00", "one long low is one start and zeros"
    assert misread(b"\xff", 9600, 19200) == b"\xfe", "the start bit is read as start and first bit"
    text = b"$HCHDG,123.4,,,,*5A\r\n" * 3
    assert misread(text, 4800, 9600) != text
    assert len(misread(text, 115200, 9600)) < len(text) / 8


def spell(kind: str, to_ns: int = 1 << 60, **more: float) -> Spell:
    return Spell(Fault.model_validate({"kind": kind, "port": "sonar", "at_s": 0.0, **more}), 0, to_ns)


def test_a_stalled_line_gives_all_at_once_later_and_a_hung_up_one_never() -> None:
    for kind, late in (("stall", b"0123456789"), ("hangup", b"")):
        line = FaultyLine(Line(10_000), 1)
        line.begin(0, spell(kind, 50 * MS))
        line.send(0, b"0123456789")
        assert line.is_hung_up(5 * MS) == (kind == "hangup")
        assert [line.take(each * MS) for each in (5, 20, 49)] == [b"", b"", b""]
        assert line.hear(10 * MS, b"ask") == (b"" if kind == "hangup" else b"ask")
        assert line.take(50 * MS) == late
        line.send(60 * MS, b"on")
        assert line.take(70 * MS) == b"on"
        assert line.hear(70 * MS, b"ask") == b"ask"


def test_messages_end_half_way() -> None:
    line = FaultyLine(Line(115200), 1)
    line.begin(0, spell("half_frame", 0))
    for t_ns in (0, S):
        line.send(t_ns, b"whole message.")
    assert line.take(2 * S) == b"whole m" + b"whole message."
    line.begin(2 * S, spell("half_frame", 4 * S))
    for t_ns in (2 * S, 3 * S, 4 * S):
        line.send(t_ns, b"whole message.")
    assert line.take(9 * S) == b"whole m" * 2 + b"whole message."


def test_garbage_takes_its_time_and_its_place_on_the_line() -> None:
    line = FaultyLine(Line(10_000), 1)
    line.send(0, b"before")
    line.begin(0, spell("garbage", 0, count=100))
    line.send(0, b"after")
    early, late = line.take(56 * MS), line.take(S)
    assert len(early) == 56
    assert early.startswith(b"before")
    assert late.endswith(b"after")
    assert len(early + late) == 111


@pytest.mark.parametrize("kind", ["drop", "double", "flip", "baud"])
def test_noise_does_not_depend_on_how_often_the_line_is_looked_at(kind: str) -> None:
    outs = []
    for step_ms in (1, 37):
        line = FaultyLine(Line(9600), 5)
        line.begin(0, spell(kind, 2 * S, **({"baud": 4800} if kind == "baud" else {"rate": 0.2})))
        got = b""
        for t_ms in range(0, 6000, step_ms):
            if t_ms % 111 == 0:
                line.send(t_ms * MS, f"{t_ms} is a message".encode())
            got += line.take(t_ms * MS)
        outs.append(got + line.take(9 * S))
    assert outs[0] == outs[1]
    assert b"0 is a message111 is a message" not in outs[0]
    assert outs[0].endswith(b"5994 is a message"), "it was over by then"


@pytest.mark.parametrize("kind", ["drop", "double", "flip", "baud"])
def test_noise_befalls_both_ways(kind: str) -> None:
    line = FaultyLine(Line(9600), 5)
    line.begin(0, spell(kind, 2 * S))
    asked = b"what the host says " * 30
    assert (line.hear(S, asked) == asked) == (kind == "baud"), "9600 is what this line speaks"
    assert line.hear(3 * S, asked) == asked
