"""The emulated vehicle with pilots who do not rest, and the options that choose them."""

from __future__ import annotations

import json
from dataclasses import replace
from math import degrees, hypot, pi
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.tools.plans import clearance_m, in_water
from tests.tools.silence import Silence
from tools.cli import main
from tools.emulator.echoes import Place
from tools.emulator.site import SITES, Stop
from tools.emulator.vehicle import MOST_DRIFT_M, PILOTS, Vehicle, VehicleOptions

S = 1_000_000_000
STILL = VehicleOptions(rest_pings=100, sway_m=0.0, heave_m=0.0, wobble_rad=0.0)
TWO = (Stop(0.0, 0.0, 1.0, 0.0), Stop(2.0, 0.0, 1.0, 1.0))


def track(stops: tuple[Stop, ...], options: VehicleOptions, phase: float, rest_s: int = 12) -> list[list[Place]]:
    """Places at each rest and on the way to the next, a fifth of a second apart."""
    vehicle = Vehicle(stops, replace(options, rest_pings=1), phase)
    vehicle.start(0)
    t_ns = 0
    parts: list[list[Place]] = []
    while not vehicle.done:
        end_ns = t_ns + rest_s * S
        part = [vehicle.place_at(each) for each in range(t_ns, end_ns, S // 5)]
        vehicle.advance(end_ns, 10 * len(parts) + 5, 0.0)
        t_ns = end_ns
        while not vehicle.done and not vehicle.advance(t_ns, 10 * len(parts) + 10, 0.0):
            part.append(vehicle.place_at(t_ns))
            t_ns += S // 5
        parts.append(part)
    return parts


def spread(places: list[Place]) -> NDArray[np.float64]:
    """Standard deviations ``(4,)`` of x, y, depth and heading."""
    rows = [(each.x_m, each.y_m, each.depth_m, (each.heading_rad + pi) % (2 * pi)) for each in places]
    return np.asarray(np.array(rows).std(axis=0), dtype=np.float64)


def test_pilots_rest_as_their_names_say() -> None:
    steady, restless = (spread(track(TWO, PILOTS[name], 1.0, 60)[0][:300]) for name in ("steady", "restless"))
    assert steady[:3].max() < 0.006
    assert degrees(steady[3]) < 0.5
    assert 0.01 < restless[:3].min() < restless[:3].max() < 0.08
    assert 0.8 < degrees(restless[3]) < 3.5


def test_a_hasty_pilot_creeps_on_and_leaves_after_one_circle() -> None:
    vehicle = Vehicle(TWO, replace(PILOTS["hasty"], sway_m=0.0, heave_m=0.0))
    vehicle.start(0)
    assert vehicle.place_at(4 * S).x_m == pytest.approx(0.1)
    assert vehicle.place_at(4 * S).y_m == pytest.approx(0.0)
    vehicle.advance(8 * S, 400, 1.0 * 2 * pi)
    assert vehicle.rests[-1].to_ns is None
    vehicle.advance(8 * S, 400, 1.06 * 2 * pi)
    assert vehicle.rests[-1].to_ns == 8 * S
    assert vehicle.place_at(8 * S).x_m == pytest.approx(0.2), "it leaves from where it has crept to"
    assert vehicle.place_at(60 * S).x_m == pytest.approx(2.0), "nowhere to creep to from the last stop"


def test_drift_grows_with_time_up_to_its_most() -> None:
    vehicle = Vehicle(TWO, replace(STILL, drift_m_s=0.01))
    vehicle.start(5 * S)
    away = [hypot(place.x_m, place.y_m) for place in map(vehicle.place_at, (5 * S, 9 * S, 15 * S, 90 * S))]
    assert away == pytest.approx([0.0, 0.04, 0.1, MOST_DRIFT_M])


@pytest.mark.parametrize("name", sorted(SITES))
def test_no_pilot_leaves_the_water(name: str) -> None:
    site = SITES[name]()
    for number, pilot in enumerate(PILOTS.values()):
        places = [each for part in track(site.stops, replace(pilot, drift_m_s=0.02), 1.3 * number) for each in part]
        levels = np.unique(np.round([each.depth_m for each in places], 1)) if site.taper_per_m else [site.plan_depth_m]
        for depth_m in levels:
            at = [each for each in places if abs(each.depth_m - depth_m) < 0.06 or not site.taper_per_m]
            points = np.array([(each.x_m, each.y_m) for each in at])
            assert in_water(site.plan_at(float(depth_m)), points)
            assert clearance_m(site.plan_at(float(depth_m)), points).min() > 0.05
        assert min(each.depth_m for each in places) > site.ceiling_m


def test_command_takes_pilot_drift_and_compass(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tools.emulator.dive.EchoModel", Silence)
    truths = []
    for number, words in enumerate((["--pilot", "steady"], ["--pilot", "restless", "--drift-m-s", "0.01"])):
        out, truth = tmp_path / f"{number}.jsonl", tmp_path / f"{number}.json"
        chosen = ["--site", "pool", "--stations", "1", "--bias-deg=-7.5", "--deviation-deg", "4", *words]
        assert main(["emulate", *chosen, "--record", str(out), "--truth", str(truth)]) == 0
        truths.append(json.loads(truth.read_text()))
        assert truths[-1]["compass"] == {"bias_deg": -7.5, "deviation_deg": 4.0, "sd_deg": 0.3}
    steady, restless = (np.array(each["trajectory"])[:120, 1:3] for each in truths)
    assert np.ptp(steady, axis=0).max() < 0.03 < np.ptp(restless, axis=0).max()
    place = truths[1]["stations"][0]
    assert hypot(place["x_m"] + 2.2, place["y_m"] - 0.4) > 0.03, "the truth is where it was, not where it meant to be"


@pytest.mark.parametrize("words", [["--bias-deg", "nan"], ["--drift-m-s", "-1"], ["--deviation-deg", "90"]])
@pytest.mark.parametrize("command", ["emulate", "demo"])
def test_commands_refuse_options_without_sense(
    command: str, words: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([command, *words]) == 64
    assert f"{words[0]} must be from" in capsys.readouterr().err
