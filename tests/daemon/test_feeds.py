"""What feeds say while the daemon runs: quality in health, a tare that the log keeps, a sensor that is asked."""

from __future__ import annotations

import contextlib
import os
import socket
import struct
import threading
import time
import tty
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from config.errors import DataError
from config.schema import Config, Feed
from daemon.beams import Beams, Tare
from daemon.pipeline import Pipeline
from drivers.keller import initialise, read_channel, read_serial, with_crc
from drivers.log import read_log
from drivers.records import Chunk, Event
from tests.daemon.rig import Rig, configuration, free_ports
from tests.drivers.feedframes import attitude, mavlink2

SECOND = 1_000_000_000
COMPASS = Feed(name="compass", port="socket://a:1", provides=("heading",))
SENSOR = Feed(name="sensor", driver="pressure", port="socket://b:1")
BOTH = Config(feed=(COMPASS, SENSOR))


def chunk(port: str, t_ns: int, data: bytes) -> Chunk:
    return Chunk(t_ns, t_ns, port, "rx", data)


def test_health_says_how_far_a_feed_is_to_be_trusted() -> None:
    beams = Beams(BOTH)
    assert beams.health("sonar", 0) == {}
    silent = beams.health("compass", 0)
    assert (silent["stale"], silent["age_s"], silent["quality"]) == (["heading"], {}, {})
    for second, letter in enumerate("NNOP"):
        body = f"PTNTHPR,85.9,{letter},-0.9,N,0.8,N".encode()
        total = 0
        for byte in body:
            total ^= byte
        beams.push(chunk("compass", second * SECOND, b"$" + body + b"*%02X\r\n" % total))
    beams.push(chunk("sensor", 3 * SECOND, b"\n1113.25\n"))
    health = beams.health("compass", 4 * SECOND)
    assert health["quality"] == {"good": 2, "suspect": 1, "bad": 1}
    assert health["last_reason"] == "compass alarm: field high (P)"
    assert health["now"] == {"heading": {"quality": "bad", "reason": "compass alarm: field high (P)"}}
    assert health["age_s"] == {"heading": 2.0}
    assert health["stale"] == ["heading"]
    assert health["readings_s"] == 1.0
    assert health["surface"] is None
    assert (health["field"], health["undisturbed_field"]) == (None, None)
    beams.push(chunk("compass", 4 * SECOND, b"$PTNTHTM,71.3,N,-0.4,N,-1.4,N,75.9,2618*03\r\n"))
    assert beams.health("compass", 4 * SECOND)["field"] == 2618.0
    depth = beams.health("sensor", 4 * SECOND)
    assert (depth["stale"], depth["surface"]) == ([], {"mbar": 1013.25, "origin": "assumed"})


def test_a_tare_is_of_the_feed_that_tells_a_pressure() -> None:
    beams = Beams(BOTH)
    with pytest.raises(DataError, match=r"no feed told an absolute pressure in the last 5 s"):
        beams.tare_of(0, None, None)
    beams.push(chunk("sensor", 0, b"\n"))
    for second in range(4):
        beams.push(chunk("sensor", second * SECOND, b"991.5\n"))
    assert beams.tare_of(4 * SECOND, None, None) == Tare("sensor", 991.5, 991.5)
    assert beams.tare_of(4 * SECOND, None, 1001.0) == Tare("sensor", 1001.0, 991.5)
    assert beams.tare_of(60 * SECOND, "sensor", 1001.0) == Tare("sensor", 1001.0, None)
    for wrong in ("compass", "sonar", "nobody"):
        with pytest.raises(DataError):
            beams.tare_of(4 * SECOND, wrong, None)
    beams.tare("sensor", 991.5)
    assert beams.health("sensor", 4 * SECOND)["surface"] == {"mbar": 991.5, "origin": "tare"}


def floor_m(pipeline: Pipeline) -> float:
    return pipeline._extent.top_and_floor_m()[1]


def test_the_map_uses_no_bad_reading_and_heeds_the_tare_in_the_log() -> None:
    pipeline = Pipeline(Config(feed=(SENSOR.model_copy(update={"max_dive_m_s": 1.0}),)))
    records: list[Chunk | Event] = [chunk("sensor", 0, b"\n1113.25\n")]
    records += [chunk("sensor", SECOND, b"9113.25\n")]  # 81 m deeper within a second
    for record in records:
        pipeline.push(record)
    assert floor_m(pipeline) == pytest.approx(1.0228, abs=1e-3)
    pipeline.push(Event(0, 0, "tare", {"port": "sensor", "surface_mbar": 913.25}))
    pipeline.push(chunk("sensor", 3 * SECOND, b"1113.25\n"))
    assert floor_m(pipeline) == pytest.approx(2.0456, abs=1e-3)


class Sensor:
    """A Keller sensor on a pseudo-terminal whose adapter gives back what it is sent; it must be initialised first."""

    def __init__(self) -> None:
        self._master, self._slave = os.openpty()
        tty.setraw(self._slave)
        os.set_blocking(self._master, False)
        self.path = os.ttyname(self._slave)
        self.heard: set[bytes] = set()
        self._end = threading.Event()
        self._thread = threading.Thread(target=self._serve)
        self._thread.start()

    def _serve(self) -> None:
        is_ready = False
        while not self._end.wait(0.01):
            with contextlib.suppress(BlockingIOError):
                asked = os.read(self._master, 4096)
                self.heard.add(asked)
                is_ready = is_ready or asked == initialise(250)
                reply = b"\x01\x49" + struct.pack(">fB", 0.9915, 0) if is_ready else b"\x01\xc9\x20"
                os.write(self._master, asked + (with_crc(reply) if asked == read_channel(250, 1) else b""))

    def close(self) -> None:
        self._end.set()
        self._thread.join()
        os.close(self._slave)
        os.close(self._master)


@pytest.fixture
def sensor() -> Iterator[Sensor]:
    made = Sensor()
    yield made
    made.close()


@pytest.fixture
def rig(tmp_path: Path) -> Iterator[Rig]:
    made = Rig(tmp_path)
    yield made
    made.close()


def depth_feed(rig: Rig) -> dict[str, Any]:
    found: dict[str, Any] = rig.health().get("ports", {}).get("depth", {})
    return found


def test_a_vehicle_is_heard_over_the_network(rig: Rig) -> None:
    silent, host = os.openpty()
    (udp,) = free_ports(1)
    path = configuration(rig.folder, os.ttyname(host), rig.ports)
    path.write_text(path.read_text() + f'[[feed]]\nname = "rov"\ndriver = "mavlink"\nport = "udp://:{udp}"\n')
    rig.run(path)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as vehicle:

        def is_heard() -> bool:
            now_ms = time.monotonic_ns() // 1_000_000 % 2**32
            vehicle.sendto(mavlink2(30, attitude(1.0, now_ms)), ("127.0.0.1", udp))
            return bool(rig.health().get("ports", {}).get("rov", {}).get("quality", {}).get("good", 0) > 5)

        rig.wait(is_heard)
    assert rig.health()["ports"]["rov"]["stale"] == ["depth"]
    rig.stop()
    os.close(host)
    os.close(silent)
    raw = b"".join(each.data for each in read_log(rig.logs) if isinstance(each, Chunk) and each.port == "rov")
    assert raw.count(b"\xfd") > 5


def test_a_polled_sensor_and_its_tare_survive_the_acquisition(rig: Rig, sensor: Sensor) -> None:
    silent, host = os.openpty()
    path = configuration(rig.folder, os.ttyname(host), rig.ports)
    lines = ['name = "depth"', 'driver = "pressure"', 'format = "keller"', "poll = true", f'port = "{sensor.path}"']
    path.write_text(path.read_text() + "\n".join(["[[feed]]", *lines, "poll_hz = 10.0", ""]))
    rig.run(path)
    rig.wait(lambda: (depth_feed(rig).get("surface") or {}).get("origin") == "assumed")
    rig.wait(lambda: bool(rig.ask(id=1, do="tare")["ok"]))
    tare = {"port": "depth", "surface_mbar": 991.5, "sensor_mbar": 991.5}
    rig.wait(lambda: depth_feed(rig)["surface"] == {"mbar": 991.5, "origin": "tare"})
    assert rig.events("tare") == [tare]
    refused = rig.ask(id=2, do="tare", port="nobody")
    assert (refused["ok"], refused["error"]["code"]) == (False, "failed")
    assert rig.ask(id=3, do="tare", surface_mbar=20.0)["error"]["code"] == "invalid"
    rig.kill("acquire")
    rig.wait(lambda: (depth_feed(rig).get("surface") or {}).get("origin") == "tare")
    rig.stop()
    os.close(host)
    os.close(silent)
    assert sensor.heard == {initialise(250), read_serial(250), read_channel(250, 1)}
    records = list(read_log(rig.logs))
    sent = {each.data for each in records if isinstance(each, Chunk) and (each.port, each.direction) == ("depth", "tx")}
    assert sent == sensor.heard
    assert [each.fields for each in records if isinstance(each, Event) and each.kind == "tare"] == [tare]
