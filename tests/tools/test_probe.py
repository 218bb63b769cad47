"""Who speaks is found from recorded bytes, and on a pseudo-terminal without a byte sent to who speaks."""

from __future__ import annotations

import contextlib
import json
import os
import threading
import tomllib
import tty
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from config.errors import PortError
from config.schema import Config
from drivers.identify import identify
from drivers.keller import read_channel
from drivers.tritech.commands import SendVersion, encode_command
from tests.drivers.feedframes import (
    PRO3_REQUEST,
    attitude,
    keller_reply,
    mavlink2,
    pro3_reply,
    pro4_navigation,
    scaled_pressure,
)
from tests.drivers.feedkit import run as decode
from tools.cli import main
from tools.probe import BAUDS, probe


def feeds(name: str) -> Callable[[Path], bytes]:
    def _read(shared_data: Path) -> bytes:
        lines = (shared_data / "feeds" / name).read_bytes().splitlines(keepends=True)
        return b"".join(line for line in lines if line[:1] == b"$")

    return _read


def mavlink(_: Path) -> bytes:
    return b"".join(
        mavlink2(30, attitude(0.1 * i, i)) + mavlink2(137, scaled_pressure(1100.0, i)) + mavlink2(9000, b"x")
        for i in range(9)
    )


RECORDED: list[tuple[Callable[[Path], bytes], str, dict[str, object]]] = [
    (lambda data: (data / "sonar" / "micron_dst_stream_20171102.bin").read_bytes()[:20_000], "tritech", {"node": 2}),
    (feeds("gpsd_sounder.nmea"), "nmea", {"provides": ["depth"]}),
    (feeds("gpsd_pypilot.nmea"), "nmea", {"provides": ["heading"]}),
    (feeds("gpsd_tnt-revolution.nmea"), "nmea", {"provides": ["heading"]}),
    (feeds("gpsd_bundg_zeus_9_filtered.nmea"), "nmea", {"provides": ["heading", "depth"]}),
    (mavlink, "mavlink", {"provides": ["heading", "depth"]}),
    (lambda _: (PRO3_REQUEST + pro3_reply(90, 500)) * 9, "videoray_pro3", {"provides": ["heading"]}),
    (lambda _: pro3_reply(90, 500) * 9, "videoray_pro3", {"provides": ["heading"]}),
    (lambda _: pro4_navigation(900, 1100) * 4, "videoray_pro4", {"provides": ["heading", "depth"]}),
    (lambda _: (read_channel(250, 1) + keller_reply(1.1)) * 4, "pressure", {"format": "keller"}),
    (lambda _: b"0009.996,M,0.000\r\n" * 8, "pressure", {"provides": ["depth"], "column": 1, "unit": "m"}),
    (lambda _: b"17.3,1017.3 mbar\r\n" * 8, "pressure", {"column": 2, "unit": "mbar", "pressure": "absolute"}),
    (lambda _: b"P: 1.73 kPa\r\n" * 8, "pressure", {"column": 2, "unit": "kpa", "pressure": "gauge"}),
    (lambda _: b"17.3;1017.3\r\n" * 8, "pressure", {"provides": ["depth"]}),
]


@pytest.mark.parametrize(("recorded", "driver", "settings"), RECORDED)
def test_recorded_bytes_are_known_for_what_they_are(
    shared_data: Path, recorded: Callable[[Path], bytes], driver: str, settings: dict[str, object]
) -> None:
    data = recorded(shared_data)
    for begin in (0, 3, 11):  # one rarely begins to listen where a message begins
        best = identify([(0, data[begin:])])[0]
        assert best.driver == driver
        assert settings.items() <= best.settings.items()
        assert best.share > 0.6


def test_what_only_people_know_is_asked_of_them(shared_data: Path) -> None:
    advice = {each[1]: identify([(0, each[0](shared_data))])[0].advice for each in RECORDED[1:]}
    assert advice["nmea"].startswith('dpt = "altitude" if')
    assert advice["videoray_pro3"].endswith("count is 500 now")
    assert "tare" in advice["mavlink"]
    assert advice["pressure"] == "set column and unit"


def test_a_line_at_a_wrong_baud_rate_is_nobody(shared_data: Path) -> None:
    # What a receiver at twice the rate makes of the bits: each seen twice.
    data = feeds("gpsd_bundg_zeus_9_filtered.nmea")(shared_data)
    bits = "".join("0" + f"{byte:08b}"[::-1] + "1" for byte in data)
    doubled = "".join(bit * 2 for bit in bits)
    wrong = bytes(int(doubled[at + 1 : at + 9][::-1], 2) for at in range(0, len(doubled) - 10, 10))
    assert identify([(0, wrong)]) == []
    assert identify([(0, b"")]) == identify([]) == []


@settings(max_examples=25, deadline=None)
@given(st.binary(max_size=2000))
def test_noise_never_raises(data: bytes) -> None:
    assert all(0 <= each.share <= 1 for each in identify([(0, data)]))


class Line:
    """A pseudo-terminal whose device repeats ``says``, and answers the first bytes that it hears with ``answers``."""

    def __init__(self, says: bytes, answers: bytes = b"") -> None:
        self.master, self._slave = os.openpty()
        tty.setraw(self._slave)
        self.path = os.ttyname(self._slave)
        self.heard = b""
        self._says, self._answers = says, answers
        self._end = threading.Event()
        self._thread = threading.Thread(target=self._serve)
        os.set_blocking(self.master, False)
        self._thread.start()

    def _serve(self) -> None:
        while not self._end.wait(0.02):
            with contextlib.suppress(BlockingIOError):
                self.heard += os.read(self.master, 4096)
                os.write(self.master, self._answers)
                self._answers = b""
            with contextlib.suppress(BlockingIOError):
                os.write(self.master, self._says)

    def close(self) -> None:
        self._end.set()
        self._thread.join()
        os.close(self._slave)
        os.close(self.master)


@pytest.fixture
def line() -> Iterator[Callable[..., Line]]:
    lines: list[Line] = []

    def _line(says: bytes, answers: bytes = b"") -> Line:
        lines.append(Line(says, answers))
        return lines[-1]

    yield _line
    for each in lines:
        each.close()


def test_who_speaks_is_found_and_left_in_peace(line: Callable[..., Line], capsys: pytest.CaptureFixture[str]) -> None:
    compass = line(b"$HCHDM,123.4,M*2D\r\n")
    assert main(["probe", compass.path, "--seconds", "3"]) == 0
    out = capsys.readouterr().out
    assert f"{compass.path} at 115200 baud: NMEA 0183 (HDM)" in out
    config = Config.model_validate(tomllib.loads(out[out.index("[[feed]]") :]))
    assert (config.feed[0].port, config.feed[0].driver) == (compass.path, "nmea")
    assert config.feed[0].provides == ("heading",)
    assert len(decode(config.feed[0], [(0, b"$HCHDM,123.4,M*2D\r\n")])[0]) == 1
    assert compass.heard == b""


def test_a_silent_head_is_asked_for_its_version_only(
    line: Callable[..., Line], capsys: pytest.CaptureFixture[str], shared_data: Path
) -> None:
    text = (shared_data / "frames" / "usc_mtVersionData.hex").read_text().split()
    head = line(b"", bytes.fromhex("".join(text)))
    assert main(["probe", head.path, "--seconds", "0.2", "--json"]) == 0
    body = json.loads(capsys.readouterr().out)
    assert body["found"]["driver"] == "tritech"
    assert [each["asked"] for each in body["tried"]] == [False] * len(BAUDS) + [True]
    assert tomllib.loads(body["toml"])["sonar"] == {
        "port": head.path, "baud": 115200, "driver": "tritech", "node": body["found"]["settings"]["node"],
    }  # fmt: skip
    question = b"".join(encode_command(SendVersion(), node) for node in (2, 3, 4))
    assert head.heard == question
    # Not what makes a VideoRay move, in any of its protocols.
    assert not any(start in question for start in (b"\x23\x31", b"\xfa\xaf", b"\xf5\x5f"))


def test_what_is_not_known_is_not_spoken_to(line: Callable[..., Line]) -> None:
    strange = line(b"\x00\x11\x22hello")
    tried = probe(strange.path, 0.2)
    assert [each.asked for each in tried] == [False] * len(BAUDS)
    assert all(each.heard == [] for each in tried)
    assert strange.heard == b""


def test_silence_and_absence_are_one_line_each(line: Callable[..., Line], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["probe", line(b"").path, "--seconds", "0.1"]) == PortError.exit_code
    assert "is silent; check power and cable" in capsys.readouterr().err
    assert main(["probe", "/dev/lacuna-no-such-port"]) == PortError.exit_code
    assert "is not there" in capsys.readouterr().err
