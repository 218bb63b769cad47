from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from config.schema import Map
from drivers.readings import Heading, Ping, Reading
from mapping.scan import ScanBuilder
from mapping.values import Scan
from tests.mapping.rooms import KEYHOLE, RECTANGLE, Stay, pings, settings


def build(readings: Sequence[Reading], config: Map | None = None) -> list[Scan]:
    builder = ScanBuilder(config or Map())
    scans = [scan for reading in readings for scan in builder.push(reading)]
    return scans + builder.finish()


def dive(*stays: Stay) -> list[Reading]:
    return list(pings(KEYHOLE, list(stays), np.random.default_rng(3)))


def tank(shared_data: Path, beams: int) -> list[Reading]:
    log = np.load(shared_data / "sonar" / "micron-tank-14scans.npz")
    bearings = np.radians(log["angle_deg"][:beams]) % (2.0 * math.pi)
    stamps = (log["time_s"][:beams] * 1e9).astype(np.int64)
    echoes, bin_m = log["intensity"], float(log["bin_m"][0])
    return [Ping(int(stamps[i]), float(bearings[i]), bin_m, echoes[i], settings()) for i in range(beams)]


def test_one_rest_is_one_scan_however_long() -> None:
    for stay in (330, 600, 1100):
        scans = build(dive(Stay(0.3, -0.5, 0.4, stay)))
        assert [(s.quality, len(s.bearing_rad)) for s in scans] == [("full", 200)]


def test_moving_away_and_resting_again_is_a_second_scan() -> None:
    scans = build(dive(Stay(0.0, -0.5, 0.4, 330), Stay(0.1, 2.0, 1.2, 330, glide=250)))
    assert [s.quality for s in scans] == ["full", "full"]
    assert [s.index for s in scans] == [0, 1]
    assert scans[1].heading_rad == pytest.approx(1.2, abs=0.02)
    assert scans[1].t_start_ns > 330 * 50_000_000


def test_a_vehicle_that_never_rests_gives_nothing() -> None:
    stays = [Stay(0.0, -1.0, 0.0, 0), *(Stay(0.3 * k, -1.0 + 0.8 * k, 0.8 * k, 0, glide=100) for k in range(1, 7))]
    assert build(dive(*stays)) == []


def test_bearings_hold_the_compass_of_their_moment() -> None:
    """A vehicle that swings by 8 degrees at rest still sees a straight world."""
    readings = dive(Stay(0.3, -0.5, 0.4, 200), Stay(0.3, -0.5, 0.4 + math.radians(8.0), 200, glide=200))
    (scan,) = build(readings)
    directions = np.unwrap(scan.heading_rad + scan.bearing_rad)
    assert np.ptp(directions) > 2.0 * math.pi - 2.0 * scan.step_rad
    told = {r.t_ns: r.heading_rad for r in readings if isinstance(r, Heading)}
    first = next(r for r in readings if isinstance(r, Ping) and r.t_ns == scan.t_start_ns)
    expected = told[min(told, key=lambda t: abs(t - scan.t_start_ns))] + first.bearing_rad
    off = (directions[0] - expected + math.pi) % (2.0 * math.pi) - math.pi
    assert abs(off) < math.radians(0.7)


def test_both_senses_of_rotation_and_either_start_are_found() -> None:
    forward = dive(Stay(0.3, -0.5, 0.0, 400))
    backward = [
        replace(r, bearing_rad=(-r.bearing_rad) % (2.0 * math.pi)) if isinstance(r, Ping) else r for r in forward
    ]
    for readings in (forward, backward, forward[137:]):
        assert [s.quality for s in build(readings)] == ["full"]


def test_without_a_compass_the_configured_heading_holds() -> None:
    readings = [r for r in dive(Stay(0.3, -0.5, 0.0, 400)) if isinstance(r, Ping)]
    assert build(readings)[0].heading_rad == 0.0
    assert build(readings, Map(heading_deg=90.0))[0].heading_rad == pytest.approx(math.pi / 2.0)
    assert math.isnan(build(readings)[0].depth_m)


def test_a_ping_waits_for_its_heading_but_no_longer_than_a_second() -> None:
    builder = ScanBuilder(Map())
    first, *rest = [r for r in dive(Stay(0.3, -0.5, 0.0, 30)) if isinstance(r, Ping)]
    builder.push(first)
    assert len(builder._held) == 1
    for ping in rest:
        builder.push(ping)
    assert all(rest[-1].t_ns - held.t_ns < 1_000_000_000 for held in builder._held)
    builder.push(Heading(rest[-1].t_ns, 0.1, "compass"))
    assert builder._held == []


def test_a_changed_range_begins_the_circle_anew() -> None:
    readings = dive(Stay(0.3, -0.5, 0.0, 150))
    later = [
        replace(r, t_ns=r.t_ns + 8_000_000_000, bin_m=0.03) if isinstance(r, Ping) else r
        for r in dive(Stay(0.3, -0.5, 0.0, 400))
    ]
    scans = build(readings + later)
    assert {s.bin_m for s in scans if s.quality == "full"} == {0.03}
    assert all(len(s.bearing_rad) <= 150 for s in scans if s.bin_m == 0.02)


def test_a_sector_at_rest_is_a_partial_scan() -> None:
    circle = [r for r in dive(Stay(0.3, -0.5, 0.0, 200)) if isinstance(r, Ping)][:80]
    there_and_back = circle + circle[-2::-1]
    readings = [replace(p, t_ns=i * 50_000_000) for i, p in enumerate(there_and_back * 3)]
    scans = build(list(readings))
    assert [s.quality for s in scans] == ["partial"]
    assert len(scans[0].bearing_rad) in (79, 80)


def test_the_end_of_the_log_gives_what_was_begun_at_rest() -> None:
    assert [s.quality for s in build(dive(Stay(0.3, -0.5, 0.0, 120)))] == ["partial"]
    assert [s.quality for s in build(dive(Stay(0.3, -0.5, 0.0, 200)))] == ["full"]
    assert [s.quality for s in build(dive(Stay(0.3, -0.5, 0.0, 240)))] == ["full"]
    assert build(dive(Stay(0.3, -0.5, 0.0, 10))) == []
    assert build([]) == []


def test_the_real_tank_is_one_rest(shared_data: Path) -> None:
    for beams in (200, 400, 2800):
        scans = build(tank(shared_data, beams))
        assert [(s.quality, s.echoes.shape) for s in scans] == [("full", (200, 399))]


def test_readings_out_of_order_by_a_little_change_nothing() -> None:
    """Two ports deliver each in its own order; a heading may come before or after the ping of its moment."""
    readings = dive(Stay(0.3, -0.5, 0.4, 330))
    delayed = sorted(readings, key=lambda r: r.t_ns + (120_000_000 if isinstance(r, Heading) else 0))
    (a,), (b,) = build(readings), build(delayed)
    np.testing.assert_allclose(a.bearing_rad, b.bearing_rad, atol=1e-9)
    assert a.t_start_ns == b.t_start_ns


def test_an_empty_room_of_noise_does_not_end_the_program() -> None:
    rng = np.random.default_rng(0)
    readings = [
        replace(r, echoes=rng.integers(0, 30, 400).astype(np.uint8)) if isinstance(r, Ping) else r
        for r in pings(RECTANGLE, [Stay(0.0, 0.0, 0.0, 500)], rng)
    ]
    assert len(build(list(readings))) <= 1
