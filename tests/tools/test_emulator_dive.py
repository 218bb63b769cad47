"""Whole emulated dives in simulated time."""

from __future__ import annotations

import json
from dataclasses import replace
from itertools import pairwise
from math import degrees, radians
from pathlib import Path

import numpy as np
import pytest

from config.errors import LogError
from config.schema import Feed, Site, Sonar
from drivers.decoders import feed_decoder
from drivers.readings import Depth, Heading, Ping
from drivers.tritech.decoder import TritechDecoder
from tools.cli import main
from tools.emulator.dive import Dive, DiveOptions
from tools.emulator.record import Piece, record, write_jsonl
from tools.emulator.site import SITES, Stop
from tools.emulator.truth import truth_of
from tools.emulator.vehicle import Vehicle, VehicleOptions

S = 1_000_000_000
SHORT = VehicleOptions(rest_pings=30)


def short_dive(seed: int = 1, options: DiveOptions | None = None) -> tuple[Dive, list[Piece]]:
    dive = Dive(SITES["keyhole"](), seed, options or DiveOptions(stations=1, vehicle=SHORT))
    return dive, list(record(dive))


@pytest.fixture(scope="module")
def recorded() -> tuple[Dive, list[Piece]]:
    dive = Dive(SITES["keyhole"](), 1, DiveOptions(stations=2))
    return dive, list(record(dive))


def pings_of(pieces: list[Piece], sonar: Sonar | None = None) -> list[Ping]:
    decoder = TritechDecoder(sonar or Sonar())
    sent = [piece for piece in pieces if (piece.port, piece.direction) == ("sonar", "rx")]
    readings = [reading for piece in sent for reading in decoder.push(piece.t_ns, piece.data)]
    assert decoder.counters.skipped_bytes == 0
    assert not decoder.counters.bad
    return [reading for reading in readings if isinstance(reading, Ping)]


def test_each_station_holds_a_full_circle_and_more_at_rest(recorded: tuple[Dive, list[Piece]]) -> None:
    dive, pieces = recorded
    pings = pings_of(pieces)
    assert [rest.index for rest in dive.vehicle.rests] == [0, 1]
    for rest in dive.vehicle.rests:
        assert rest.to_ns is not None
        during = [ping for ping in pings if rest.from_ns <= ping.t_ns <= rest.to_ns]
        assert 200 * 1.38 <= len(during) <= 200 * 1.6
        assert len({round(degrees(ping.bearing_rad), 1) for ping in during}) == 200


def test_truth_tells_rests_track_and_walls(recorded: tuple[Dive, list[Piece]]) -> None:
    dive, pieces = recorded
    truth = json.loads(json.dumps(truth_of(dive)))
    assert truth["done"]
    stations = truth["stations"]
    assert [each["index"] for each in stations] == [0, 1]
    track = np.array(truth["trajectory"])
    assert np.diff(track[:, 0]).max() < 0.3 * S
    assert track[-1, 0] == pytest.approx(pieces[-1].t_ns, abs=0.3 * S)
    for station in stations:
        resting = track[(track[:, 0] >= station["rest_from_ns"]) & (track[:, 0] <= station["rest_to_ns"])]
        assert np.hypot(resting[:, 1] - station["x_m"], resting[:, 2] - station["y_m"]).max() < 0.02
        assert np.abs(resting[:, 4] - station["heading_deg"] + 180).max() % 360 == pytest.approx(180, abs=1.0)
    speed = np.hypot(np.diff(track[:, 1]), np.diff(track[:, 2])) / np.diff(track[:, 0]) * S
    assert speed.max() < 0.5
    assert truth["walls"][0]["closed"]


def test_scan_shows_the_wall_where_the_truth_has_it(recorded: tuple[Dive, list[Piece]]) -> None:
    dive, pieces = recorded
    rest = dive.vehicle.rests[0]
    assert rest.to_ns is not None
    wall = dive.site.walls[0].points_m
    near = []
    for ping in pings_of(pieces)[:200]:
        angle = rest.stop.heading_rad + ping.bearing_rad
        beyond = int(0.6 / ping.bin_m)
        range_m = (beyond + int(ping.echoes[beyond:200].argmax()) + 0.5) * ping.bin_m
        point = (rest.stop.x_m + range_m * np.sin(angle), rest.stop.y_m + range_m * np.cos(angle))
        near.append(np.linalg.norm(wall - np.array(point), axis=1).min() < 0.25)
    assert np.mean(near) > 0.75


def test_feed_tells_heading_and_depth_of_the_stop(recorded: tuple[Dive, list[Piece]]) -> None:
    dive, pieces = recorded
    decoder = feed_decoder(Feed(), Site())
    readings = [r for piece in pieces if piece.port == "feed" for r in decoder.push(piece.t_ns, piece.data)]
    rest = dive.vehicle.rests[1]
    assert rest.to_ns is not None
    during = [r for r in readings if rest.from_ns <= r.t_ns <= rest.to_ns]
    compass = np.mean([degrees(r.heading_rad) for r in during if isinstance(r, Heading)])
    assert compass == pytest.approx(degrees(rest.stop.heading_rad), abs=3.0)
    assert np.mean([r.depth_m for r in during if isinstance(r, Depth)]) == pytest.approx(1.3, abs=0.02)


def test_a_dive_is_a_function_of_its_seed() -> None:
    first, again, other = (short_dive(seed)[1] for seed in (1, 1, 2))
    assert first == again
    assert first != other


def test_vehicle_waits_for_the_first_ping() -> None:
    dive = Dive(SITES["pool"](), 1, DiveOptions(vehicle=SHORT))
    for step in range(1, 2000):
        dive.tick(step * S // 100)
        dive.advance(step * S // 100)
    assert not dive.vehicle.started
    assert truth_of(dive)["stations"] == []


def test_a_slow_scan_makes_rests_longer() -> None:
    dive = Dive(SITES["pool"](), 1, DiveOptions(stations=1))
    pieces = list(record(dive, Sonar(range_m=20.0, step_deg=0.9)))
    (rest,) = dive.vehicle.rests
    assert rest.to_ns is not None
    assert rest.to_ns - rest.from_ns > 20 * S
    assert len(pings_of(pieces)) >= 400 * 1.39


def test_mounting_of_the_head_is_undone_by_the_configuration() -> None:
    plain = pings_of(short_dive()[1])[:20]
    options = DiveOptions(stations=1, vehicle=SHORT, mount_rad=radians(90.0), upside_down=True)
    turned = pings_of(short_dive(1, options)[1], Sonar(mount_deg=90.0, inverted=True))[:20]
    assert degrees(turned[0].bearing_rad) == pytest.approx(90.0)
    assert degrees(turned[1].bearing_rad) == pytest.approx(88.2)
    assert degrees(plain[1].bearing_rad) == pytest.approx(1.8)


def test_vehicle_moves_smoothly_along_its_path() -> None:
    stops = (Stop(0.0, 0.0, 1.0, 6.2), Stop(2.0, 2.0, 1.5, 0.2, via_m=((2.0, 0.0),)))
    vehicle = Vehicle(stops, replace(SHORT, rest_pings=5, sway_m=0.0, wobble_rad=0.0))
    vehicle.start(0)
    assert not vehicle.advance(S, 4, 0.0)
    assert not vehicle.advance(2 * S, 5, 0.0)
    places = [vehicle.place_at(2 * S + step * S // 20) for step in range(500)]
    assert (places[0].x_m, places[0].y_m) == (0.0, 0.0)
    assert (places[-1].x_m, places[-1].y_m) == pytest.approx((2.0, 2.0))
    assert max(place.x_m - 2.0 for place in places) < 1e-9, "by way of the given point"
    assert all(place.y_m < 1e-9 or place.x_m > 2.0 - 1e-9 for place in places)
    jumps = [np.hypot(b.x_m - a.x_m, b.y_m - a.y_m) for a, b in pairwise(places)]
    assert max(jumps) <= 0.4 / 20 * 1.01
    turned = [(place.heading_rad + np.pi) % (2 * np.pi) - np.pi for place in places]
    assert min(turned) >= 6.2 - 2 * np.pi - 1e-9, "the short way round"
    assert vehicle.advance(21 * S, 9, 0.0), "a rest begins"
    assert vehicle.advance(22 * S, 14, 0.0), "the last rest was long enough"
    assert vehicle.done
    assert not vehicle.advance(23 * S, 99, 0.0)


def test_command_records_a_dive(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out, truth = tmp_path / "dive.jsonl", tmp_path / "truth.json"
    words = ["emulate", "--site", "pool", "--stations", "1", "--record", str(out), "--truth", str(truth), "--json"]
    assert main(words) == 0
    lines = [json.loads(line) for line in out.read_text().splitlines()]
    assert json.loads(capsys.readouterr().out) == {"event": "recorded", "pieces": len(lines), "stations": 1}
    assert {(line["port"], line["dir"]) for line in lines} == {("sonar", "rx"), ("sonar", "tx"), ("feed", "rx")}
    assert all(a["t_ns"] <= b["t_ns"] for a, b in pairwise(lines))
    assert json.loads(truth.read_text())["site"] == "pool"


@pytest.mark.parametrize("words", [["--stations", "0"], ["--speed", "0"], ["--site", "atlantis"], ["--seed", "-1"]])
def test_command_refuses_what_makes_no_sense(words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["emulate", *words]) == 64
    assert len(capsys.readouterr().err.splitlines()) == 1


def test_unwritable_file_is_one_error(tmp_path: Path) -> None:
    with pytest.raises(LogError, match="cannot write"):
        write_jsonl([Piece(1, "sonar", "rx", b"x")], tmp_path / "absent" / "dive.jsonl")
