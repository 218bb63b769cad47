"""The daemon as it runs: real processes on real pseudo-terminals."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from daemon.broker import Broker
from daemon.pipeline import Pipeline
from daemon.state import grid_digest, mesh_digest, poses_digest
from drivers.log import read_header, read_log
from drivers.records import Chunk, Event
from tests.daemon.rig import PATIENCE_S, Rig, configuration, free_ports
from tools.cli import main


def replayed(logs: Path) -> dict[str, str]:
    pipeline = Pipeline(read_header(logs).config)
    for record in read_log(logs):
        pipeline.push(record)
    pipeline.finish()
    state = pipeline.state
    return {
        "poses": poses_digest(state.stations),
        "grid": grid_digest(state.grid),
        "mesh": mesh_digest(state.mesh),
    }


def newest_gain_pct(rig: Rig) -> object:
    newest = rig.newest("ping")
    return None if newest is None else newest.snapshot.fields["gain_pct"]


def is_alive(pid: int | None) -> bool:
    try:
        return " Z " not in Path(f"/proc/{pid}/stat").read_text()
    except OSError:
        return False


def events(logs: Path) -> list[str]:
    return [record.kind for record in read_log(logs) if isinstance(record, Event)]


def test_a_dive_with_kills_gives_the_map_of_its_log(rig: Rig) -> None:
    rig.emulate(speed=8.0, stations=1)
    ports = rig.folder / "ports"
    rig.run(configuration(rig.folder, ports / "sonar", rig.ports, ports / "feed"), rate=8.0)
    rig.wait(lambda: rig.count("ping") > 20)
    assert rig.ask(id=1, do="mark", text="stairs")["ok"] is True
    assert rig.ask(id=2, do="drop", station=99)["error"]["code"] == "invalid"
    rig.kill("acquire")
    rig.wait(lambda: rig.newest("station") is not None)
    rig.kill("map")
    rig.wait(lambda: rig.health()["map"].get("is_level", False) and rig.health()["map"]["stations"] >= 1)
    topics_of_a_late_joiner(rig)
    saved = rig.ask(id=3, do="save")
    assert saved["ok"] is True
    assert saved["log"]["error"] is None
    assert rig.ask(id=4, do="status")["processes"]["map"]["restarts"] == 1
    outcome = rig.stop()
    assert outcome["map"]["is_final"] is True
    assert {key: outcome["map"][key] for key in ("poses", "grid", "mesh")} == replayed(rig.logs)
    assert outcome["map"]["stations"] >= 1
    kinds = events(rig.logs)
    assert kinds.count("started") == 2
    assert kinds.count("mark") == 1
    assert kinds[-1] == "stopped"
    assert [path.name for path in rig.logs.glob("*.part")] == [f"{outcome['session']}-0001.mcap.part"]


def topics_of_a_late_joiner(rig: Rig) -> set[str]:
    reader = rig.subscriber()
    topics: set[str] = set()
    try:
        while not {"station", "grid/key", "fill", "mesh", "guide"} <= topics:
            assert reader.poll(30_000), topics
            topics.add(reader.recv_multipart()[0].decode())
    finally:
        reader.close(linger=0)
    return topics


def test_the_sonar_is_set_and_stopped_on_request(rig: Rig) -> None:
    rig.emulate(speed=10.0, stations=1)
    rig.run(configuration(rig.folder, rig.folder / "ports" / "sonar", rig.ports), rate=10.0)
    rig.wait(lambda: rig.count("ping") > 5)
    assert rig.ask(id=1, do="sonar", gain_pct=30, range_m=5)["ok"] is True
    rig.wait(lambda: newest_gain_pct(rig) == pytest.approx(30, abs=1))
    assert rig.ask(id=2, do="sonar", stop=True)["ok"] is True
    rig.wait(lambda: rig.health().get("sonar", {}).get("state") == "stopped")
    rig.stop()
    assert events(rig.logs).count("settings") == 2


def test_a_lost_port_comes_back_by_itself(rig: Rig) -> None:
    vehicle = rig.emulate(speed=4.0, stations=1)
    rig.run(configuration(rig.folder, rig.folder / "ports" / "sonar", rig.ports), rate=4.0)
    rig.wait(lambda: rig.count("ping") > 5)
    vehicle.terminate()
    vehicle.wait()
    rig.wait(lambda: bool(rig.events("port_lost")))
    before = rig.count("ping")
    rig.emulate(speed=4.0, stations=1)
    rig.wait(lambda: rig.count("ping") > before + 5)
    rig.stop()
    kinds = events(rig.logs)
    assert [kind for kind in kinds if kind.startswith("port")] == ["port_opened", "port_lost", "port_opened"]


def test_what_a_port_delivered_survives_a_kill(rig: Rig, line: tuple[int, str]) -> None:
    ours, theirs = line
    rig.run(configuration(rig.folder, theirs, rig.ports))
    rig.wait(lambda: rig.pid("acquire") is not None and rig.health().get("ports", {}).get("sonar") is not None)
    os.write(ours, b"delivered")
    time.sleep(0.4)
    rig.kill("acquire")
    rig.stop()
    received = b"".join(each.data for each in read_log(rig.logs) if isinstance(each, Chunk) and each.direction == "rx")
    assert received == b"delivered"


def test_the_children_end_with_the_supervisor(rig: Rig, line: tuple[int, str]) -> None:
    daemon = rig.run(configuration(rig.folder, line[1], rig.ports))
    rig.wait(lambda: rig.pid("acquire") is not None and rig.pid("map") is not None)
    children = [rig.pid("acquire"), rig.pid("map")]
    daemon.send_signal(signal.SIGKILL)
    daemon.wait()
    end_s = time.monotonic() + PATIENCE_S
    while any(is_alive(pid) for pid in children):
        assert time.monotonic() < end_s
        time.sleep(0.05)
    assert events(rig.logs)[-1] == "stopped"
    assert not list(rig.logs.glob("*.part"))


def test_a_map_that_hangs_does_not_hold_up_the_end(rig: Rig, line: tuple[int, str]) -> None:
    rig.run(configuration(rig.folder, line[1], rig.ports), map_wait_s=0.5)
    rig.wait(lambda: rig.pid("map") is not None)
    pid = rig.pid("map")
    assert pid is not None
    os.kill(pid, signal.SIGSTOP)
    outcome = rig.stop()
    assert not outcome["map"].get("is_final")
    assert events(rig.logs)[-1] == "stopped"


def test_a_signal_to_all_processes_ends_them_in_order(rig: Rig, line: tuple[int, str]) -> None:
    rig.run(configuration(rig.folder, line[1], rig.ports))
    rig.wait(lambda: "map" in rig.health())
    for name in ("map", "acquire"):
        pid = rig.pid(name)
        assert pid is not None
        os.kill(pid, signal.SIGTERM)
    outcome = rig.stop()
    assert outcome["map"]["is_final"] is True
    assert outcome["map"]["records"] == len(list(read_log(rig.logs)))
    assert not list(rig.logs.glob("*.part"))


def fails(words: list[str], capsys: pytest.CaptureFixture[str]) -> tuple[int, str]:
    code = main(words)
    error = capsys.readouterr().err
    assert error.count("\n") == 1, error
    return code, error


def test_a_second_daemon_on_a_port_is_refused(
    rig: Rig, line: tuple[int, str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rig.run(configuration(rig.folder, line[1], rig.ports))
    rig.wait(lambda: rig.health().get("ports", {}).get("sonar", {}).get("state") == "open")
    (tmp_path / "second").mkdir()
    one, two = free_ports(2)
    second = configuration(tmp_path / "second", line[1], (one, two))
    code, error = fails(["run", "--config", str(second)], capsys)
    assert code == 69
    assert "in use" in error
    assert not (tmp_path / "second" / "logs").exists()
    rig.stop()


def test_a_port_that_is_not_there(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    one, two = free_ports(2)
    config = configuration(tmp_path, tmp_path / "ttyUSB9", (one, two))
    code, error = fails(["run", "--config", str(config)], capsys)
    assert code == 69
    assert "ttyUSB9 is not there" in error
    assert not (tmp_path / "logs").exists()


def test_a_busy_address(tmp_path: Path, line: tuple[int, str], capsys: pytest.CaptureFixture[str]) -> None:
    one, two = free_ports(2)
    config = configuration(tmp_path, line[1], (one, two))
    from config.load import load_config

    with Broker(load_config(config).publish, "other"):
        code, error = fails(["run", "--config", str(config)], capsys)
    assert code == 69
    assert f":{one} is in use" in error
    assert not (tmp_path / "logs").exists()


def test_a_folder_that_cannot_be_written(
    tmp_path: Path, line: tuple[int, str], capsys: pytest.CaptureFixture[str]
) -> None:
    one, two = free_ports(2)
    config = configuration(tmp_path, line[1], (one, two))
    (tmp_path / "logs").write_text("a file in the way")
    code, error = fails(["run", "--config", str(config)], capsys)
    assert code == 74
    assert "cannot write" in error


@pytest.mark.parametrize(
    ("text", "says"),
    [("[sonar]\nrang_m = 1\n", "did you mean 'range_m'?"), ('[publish]\nbind = "tcp://0.0.0.0"\n', "lacuna keygen")],
)
def test_a_wrong_configuration(text: str, says: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "c.toml").write_text(text)
    code, error = fails(["run", "--config", str(tmp_path / "c.toml")], capsys)
    assert code == 78
    assert says in error


def test_the_acquisition_knows_nothing_of_the_map() -> None:
    program = "import sys, daemon.acquire; print(*sorted({name.split('.')[0] for name in sys.modules}))"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert not {"scipy", "skimage", "mapping", "fill", "tools"} & set(done.stdout.split())
