from __future__ import annotations

import json
import os
import re
import socket
import subprocess
import sys
import threading
from pathlib import Path

import pytest
import zmq

from config.schema import Config
from daemon.wire import Message, decode
from drivers.log import LogWriter, read_header
from drivers.records import ClockPair
from tools.cli import ONE_THREAD, main


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def files(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in sorted(folder.iterdir())}


def test_the_same_log_gives_the_same_files(dive_log: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["replay", str(dive_log), "-o", str(tmp_path / "a")]) == 0
    assert re.fullmatch(r"2 of 2 stations placed, \d+ holes filled; results in .*a\n", capsys.readouterr().out)
    segments = [str(path) for path in sorted(dive_log.iterdir())]
    assert len(segments) > 1
    assert main(["replay", *segments, "--speed", "500", "--out", str(tmp_path / "b"), "--json"]) == 0
    report = json.loads(capsys.readouterr().out)
    assert report["stations"] == {"placed": 2}
    assert files(tmp_path / "a") == files(tmp_path / "b")
    assert {"map.pgm", "filled.yaml", "fills.csv", "poses.csv", "mesh.ply", "plan.png"} <= set(files(tmp_path / "a"))


def test_the_number_of_threads_that_somebody_set_changes_no_byte(dive_log: Path, tmp_path: Path) -> None:
    for threads in ("1", "4"):
        words = [sys.executable, "-m", "tools.cli", "replay", str(dive_log), "-o", str(tmp_path / threads)]
        subprocess.run(words, check=True, env=os.environ | dict.fromkeys(ONE_THREAD, threads), capture_output=True)
    assert files(tmp_path / "1") == files(tmp_path / "4")


def test_a_replay_on_the_air_is_a_live_dive(dive_log: Path, tmp_path: Path) -> None:
    port, request_port = free_port(), free_port()
    body = f"[site]\nname = 'keyhole'\n[publish]\nport = {port}\nrequest_port = {request_port}\n[[feed]]\n"
    (tmp_path / "c.toml").write_text(body)
    told: list[Message] = []
    done = threading.Event()
    with zmq.Context() as context:

        def listen() -> None:
            with context.socket(zmq.SUB) as reader:
                reader.subscribe("")
                reader.connect(f"tcp://127.0.0.1:{port}")
                while not done.is_set() or reader.poll(0):
                    if reader.poll(50):
                        told.append(decode(reader.recv_multipart()))

        listener = threading.Thread(target=listen)
        listener.start()
        words = ["replay", str(dive_log), "--publish", "--speed", "15", "--config", str(tmp_path / "c.toml")]
        try:
            assert main(words) == 0
        finally:
            done.set()
            listener.join()
    topics = {message.snapshot.topic for message in told}
    assert {"ping", "station", "grid/key", "fill", "mesh", "guide", "health", "event"} <= topics
    newest = [message for message in told if message.snapshot.topic == "station"][-1]
    assert newest.snapshot.fields["newest"] == 1
    assert sum(message.snapshot.topic == "ping" for message in told) > 300


@pytest.mark.parametrize(
    ("words", "code", "says"),
    [
        (["{log}"], 64, "needs -o DIR"),
        (["{log}", "--speed", "0", "-o", "{tmp}/o"], 64, "a number above 0 or max"),
        (["{tmp}/none.mcap", "-o", "{tmp}/o"], 66, "does not exist"),
        (["{tmp}/empty", "-o", "{tmp}/o"], 65, "holds no logs"),
        (["{tmp}/text.mcap", "-o", "{tmp}/o"], 65, "not a log"),
        (["{tmp}/two", "-o", "{tmp}/o"], 65, "2 sessions (one, two)"),
        (["{log}", "--config", "{tmp}/none.toml", "-o", "{tmp}/o"], 66, "cannot read"),
    ],
)
def test_what_is_wrong_is_one_line(
    words: list[str], code: int, says: str, dive_log: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "empty").mkdir()
    (tmp_path / "text.mcap").write_text("not a log\n" * 50)
    for session in ("one", "two"):
        with LogWriter(tmp_path / "two", session, Config(), {}) as log:
            log.write(ClockPair(1, 1))
    assert main(["replay", *(word.format(log=dive_log, tmp=tmp_path) for word in words)]) == code
    error = capsys.readouterr().err
    assert says in error
    assert error.count("\n") == 1
    assert not (tmp_path / "o").exists()


def test_a_log_without_pings_is_an_empty_map(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with LogWriter(tmp_path / "log", "s", Config(), {}) as log:
        log.write(ClockPair(1, 1))
    assert main(["replay", str(tmp_path / "log"), "-o", str(tmp_path / "out")]) == 0
    assert capsys.readouterr().out.startswith("0 of 0 stations placed")


def test_another_configuration_is_another_map(dive_log: Path, tmp_path: Path) -> None:
    config = read_header(dive_log).config
    assert config.map.cell_m == 0.05
    (tmp_path / "c.toml").write_text("[site]\nname = 'keyhole'\n[map]\ncell_m = 0.1\n[[feed]]\n")
    words = ["replay", str(dive_log), "--config", str(tmp_path / "c.toml"), "-o", str(tmp_path / "out")]
    assert main(words) == 0
    assert json.loads((tmp_path / "out" / "report.json").read_text())["grid"]["cell_m"] == 0.1
