"""The operator sets the sonar while the daemon records: range, gain, step and sector, on port 5557."""

from __future__ import annotations

import math

import pytest

from config.schema import Sonar
from drivers.log import read_log
from drivers.readings import Ping
from drivers.records import Chunk, Event, Record
from drivers.tritech.decoder import TritechDecoder
from tests.daemon.rig import Rig, configuration


def newest(rig: Rig) -> dict[str, float]:
    message = rig.newest("ping")
    return (
        {}
        if message is None
        else {key: value for key, value in message.snapshot.fields.items() if isinstance(value, float)}
    )


def sonar(rig: Rig) -> dict[str, object]:
    """Return what health says of the sonar, if anything yet."""
    return dict(rig.health().get("sonar", {}))


def test_the_sonar_is_set_while_it_scans(rig: Rig) -> None:
    rig.emulate(speed=4.0, stations=1)
    rig.run(configuration(rig.folder, rig.folder / "ports" / "sonar", rig.ports), rate=4.0)
    rig.wait(lambda: rig.count("ping") > 20)
    assert rig.ask(id=1, do="sonar", range_m=5.0)["ok"] is True
    rig.wait(lambda: newest(rig)["range_m"] == pytest.approx(5.0, rel=0.05))
    assert rig.ask(id=2, do="sonar", gain_pct=70.0)["ok"] is True
    rig.wait(lambda: newest(rig)["gain_pct"] == pytest.approx(70.0, abs=0.5))
    assert rig.ask(id=3, do="sonar", step_deg=0.9, sector_deg=[-20, 40])["ok"] is True
    rig.wait(lambda: newest(rig)["step_deg"] == pytest.approx(0.9, abs=0.01))
    before = rig.count("ping")
    rig.wait(lambda: rig.count("ping") > before + 60 and sonar(rig).get("s_per_revolution") is not None)
    assert sonar(rig)["limited_by"] in ("line", "sound", "other")
    assert rig.ask(id=4, do="sonar", gain_pct=700.0)["error"]["code"] == "invalid"
    assert "range_m" in rig.ask(id=5, do="sonar", range_m=None)["error"]["message"]
    assert "a sector wider than" in rig.ask(id=6, do="sonar", sector_deg=[10, 10])["error"]["message"]
    rig.stop()
    records = list(read_log(rig.logs))
    kinds = [record.kind for record in records if isinstance(record, Event)]
    assert (kinds.count("started"), kinds.count("settings"), kinds.count("port_lost")) == (1, 3, 0)
    assert len(list(rig.logs.iterdir())) == 1, "the log went on"
    assert_settings(records)


def test_settings_outlive_the_acquisition(rig: Rig) -> None:
    rig.emulate(speed=8.0, stations=1)
    rig.run(configuration(rig.folder, rig.folder / "ports" / "sonar", rig.ports), rate=8.0)
    rig.wait(lambda: rig.count("ping") > 5)
    assert rig.ask(id=1, do="sonar", stop=True)["ok"] is True
    assert rig.ask(id=2, do="sonar", start=True, gain_pct=70.0)["ok"] is True
    rig.wait(lambda: newest(rig)["gain_pct"] == pytest.approx(70.0, abs=0.5))
    rig.kill("acquire")
    before = rig.count("ping")
    rig.wait(lambda: rig.count("ping") > before + 20)
    assert newest(rig)["gain_pct"] == pytest.approx(70.0, abs=0.5)
    rig.wait(lambda: sonar(rig).get("gain_pct") == 70.0)
    rig.stop()


def assert_settings(records: list[Record]) -> None:
    """Each change holds from a few pings after it was asked for."""
    decoder = TritechDecoder(Sonar())
    pings: list[Ping] = []
    since: list[int] = []
    for record in records:
        if isinstance(record, Event) and record.kind == "settings":
            since.append(len(pings))
        if isinstance(record, Chunk) and record.direction == "rx":
            pings += [each for each in decoder.push(record.t_ns, record.data) if isinstance(each, Ping)]
    first, second, third = (start + 4 for start in since)
    assert {round(ping.head.range_m) for ping in pings[: since[0]]} == {10}
    assert {round(ping.head.range_m) for ping in pings[first:]} == {5}
    assert {round(ping.head.gain_pct) for ping in pings[: since[1]]} == {50}
    assert {round(ping.head.gain_pct) for ping in pings[second:]} == {70}
    last = pings[third:]
    assert {(round(math.degrees(ping.head.step_rad), 1), ping.head.continuous) for ping in last} == {(0.9, False)}
    degrees = [math.degrees(math.remainder(ping.bearing_rad, math.tau)) for ping in last]
    assert min(degrees) >= -20.1
    assert max(degrees) <= 40.1
