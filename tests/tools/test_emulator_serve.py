"""The emulation on real pseudo-terminals, in a process of its own."""

from __future__ import annotations

import argparse
import json
import os
import select
import signal
import termios
import threading
import time
import tty
from collections.abc import Iterator
from pathlib import Path
from subprocess import Popen

import pytest

from config.errors import InputError, PortError, UsageError
from config.schema import Feed, Site, Sonar
from drivers.decoders import feed_decoder
from drivers.readings import Depth, Heading, Reading
from drivers.tritech.decoder import TritechDecoder
from drivers.tritech.head import Head
from tools.emulator import options
from tools.emulator.dive import DiveOptions
from tools.emulator.feeds import FeedOptions
from tools.emulator.head import HeadOptions
from tools.emulator.ptys import FolderLock, PtyPort
from tools.emulator.serve import Emulation, spawn
from tools.probe import probe

SPEED = 8.0


class Host:
    """The other side of both ports: the host that drives real heads, in the emulation's hurried time."""

    def __init__(self, folder: Path) -> None:
        self.readings: list[Reading] = []
        self.decoder = TritechDecoder(Sonar())
        self._feed_decoder = feed_decoder(Feed(), Site())
        self._head = Head(Sonar())
        self._sonar, self._feed = (_open(folder / name) for name in ("sonar", "feed"))
        self._start = time.monotonic()

    def run(self, until_pings: int, limit_s: float = 30.0) -> int:
        pings = 0
        end = time.monotonic() + limit_s
        while pings < until_pings and time.monotonic() < end:
            ready, _, _ = select.select([self._sonar, self._feed], [], [], 0.002)
            t_ns = int((time.monotonic() - self._start) * SPEED * 1e9)
            data = os.read(self._sonar, 65536) if self._sonar in ready else b""
            pings += len(self.decoder.push(t_ns, data))
            os.write(self._sonar, self._head.push(t_ns, data) if data else self._head.tick(t_ns))
            if self._feed in ready:
                self.readings += self._feed_decoder.push(t_ns, os.read(self._feed, 65536))
        return pings

    def close(self) -> None:
        os.close(self._sonar)
        os.close(self._feed)


def _open(path: Path) -> int:
    handle = os.open(path, os.O_RDWR | os.O_NOCTTY)
    tty.setraw(handle)
    termios.tcflush(handle, termios.TCIFLUSH)
    return handle


def event(process: Popen[str]) -> dict[str, object]:
    assert process.stdout is not None
    line: dict[str, object] = json.loads(process.stdout.readline())
    return line


@pytest.fixture
def served(tmp_path: Path) -> Iterator[tuple[Path, Popen[str]]]:
    folder = tmp_path / "ports"
    process = spawn(folder, "keyhole", 1, SPEED, 1, tmp_path / "truth.json", "--pilot", "restless")
    try:
        assert event(process) == {"event": "ready", "sonar": str(folder / "sonar"), "feed": str(folder / "feed")}
        yield folder, process
    finally:
        process.kill()
        process.wait()
        assert process.stdout is not None
        process.stdout.close()


def test_dive_over_terminals_survives_a_host_that_comes_and_goes(served: tuple[Path, Popen[str]]) -> None:
    folder, process = served
    first = Host(folder)
    assert first.run(40) >= 40
    first.close()
    assert event(process)["event"] == "station"
    second = Host(folder)
    assert second.run(230) >= 230
    assert second.decoder.counters.skipped_bytes < 2000, "the tail of a cut frame at most"
    assert {type(reading) for reading in second.readings} == {Heading, Depth}
    second.run(10_000, limit_s=1.0)
    second.close()
    done = event(process)
    assert done["event"] == "done"
    process.send_signal(signal.SIGTERM)
    assert process.wait(20) == 0
    assert list(folder.iterdir()) == []
    truth = json.loads((folder.parent / "truth.json").read_text())
    assert truth["done"]
    assert len(truth["stations"]) == 1


def test_ctrl_c_ends_it_cleanly_before_anything_was_asked(served: tuple[Path, Popen[str]]) -> None:
    folder, process = served
    process.send_signal(signal.SIGINT)
    assert process.wait(20) == 0
    assert list(folder.iterdir()) == []
    assert json.loads((folder.parent / "truth.json").read_text())["stations"] == []


def test_second_emulation_in_the_same_folder_is_refused(tmp_path: Path) -> None:
    first = Emulation(tmp_path)
    try:
        with pytest.raises(PortError, match="in use by another"):
            Emulation(tmp_path)
        assert (tmp_path / "sonar").exists()
    finally:
        first.close()
    Emulation(tmp_path).close()


def test_stale_name_is_replaced_and_a_file_is_not(tmp_path: Path) -> None:
    (tmp_path / "sonar").symlink_to("/dev/pts/nowhere")
    Emulation(tmp_path).close()
    (tmp_path / "feed").write_text("someone's notes")
    with pytest.raises(InputError, match="cannot make"):
        Emulation(tmp_path)
    assert (tmp_path / "feed").read_text() == "someone's notes"
    assert not (tmp_path / "sonar").exists()
    FolderLock(tmp_path).release()


def test_folder_that_cannot_be_made_is_one_error(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="cannot use folder"):
        Emulation(tmp_path / "file" / "ports")


def test_port_is_raw_and_forgets_what_nobody_reads(tmp_path: Path) -> None:
    port = PtyPort(tmp_path / "sonar")
    try:
        old = bytes(range(256)) * 100
        port.write(0, old)
        while port._unread() < 2048:  # the kernel hands bytes from one side to the other in its own time
            time.sleep(0.001)
        port.write(1_000_000_000, b"still waiting")
        port.write(4_000_000_000, b"")
        handle = os.open(tmp_path / "sonar", os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        with pytest.raises(BlockingIOError):
            os.read(handle, 100)
        port.write(5_000_000_000, bytes(range(256)))
        os.write(handle, b"\x03\x0a\x0d\x11@")
        select.select([port], [], [], 5.0)
        assert port.read() == b"\x03\x0a\x0d\x11@"
        assert os.read(handle, 1000) == bytes(range(256))
        os.close(handle)
        assert port.read() == b""
    finally:
        port.unplug()
    port.unplug()
    assert not (tmp_path / "sonar").is_symlink()


def test_a_host_at_another_rate_hears_noise_and_a_probe_finds_the_right_one(tmp_path: Path) -> None:
    devices = DiveOptions(head=HeadOptions(baud=57600, centring_s=0.5), feed=FeedOptions(baud=19200))
    emulation = Emulation(tmp_path, options=devices)
    is_over = threading.Event()
    serving = threading.Thread(target=emulation.serve, args=(is_over.is_set,))
    serving.start()
    try:
        for name, baud, driver in (("sonar", 57600, "tritech"), ("feed", 19200, "nmea")):
            tried = probe(str(tmp_path / name), 1.3)
            understood = [each for each in tried if each.heard]
            assert [(each.baud, each.heard[0].driver) for each in understood] == [(baud, driver)]
            assert not any(each.asked for each in tried)
    finally:
        is_over.set()
        serving.join()
        emulation.close()


@pytest.mark.parametrize(
    ("words", "sonar", "feed"),
    [
        ([], {"baud": 115200, "head_type": "dst"}, {"baud": 4800, "provides": ["heading", "depth"]}),
        (
            ["--head", "non-dst", "--sonar-baud", "57600", "--odometry"],
            {"baud": 57600, "head_type": "non-dst"},
            {"baud": 9600, "provides": ["heading", "depth", "odometry"]},
        ),
    ],
)
def test_what_was_chosen_reaches_another_command_and_the_configuration(
    words: list[str], sonar: dict[str, object], feed: dict[str, object]
) -> None:
    parser = argparse.ArgumentParser()
    options.add_arguments(parser)
    args = parser.parse_args([*words, "--half-duplex", "--aux-hz", "2"])
    again = parser.parse_args(options.words(args))
    assert options.dive_options(again) == options.dive_options(args)
    assert options.dive_options(args).head.replies_per_request == 1
    assert options.configured(again) == {"sonar": sonar, "feed": feed}
    with pytest.raises(UsageError, match="--aux-hz must be from 0 to 20"):
        options.dive_options(parser.parse_args(["--aux-hz", "50"]))
