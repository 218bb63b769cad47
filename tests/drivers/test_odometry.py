"""The way of the vehicle as velocity logs and autopilots tell it: displacements in known axes, and their worth."""

from __future__ import annotations

import math
import struct

import pytest

from config.schema import Feed, Site
from drivers.feed import FeedDecoder
from drivers.identify import identify
from drivers.mavlink import mavlink_reader
from drivers.nmea import NmeaReader
from drivers.readings import Odometry, Reading, is_usable
from tests.drivers.feedframes import mavlink2

SECOND = 1_000_000_000
LOG = Feed(port="socket://log:1", provides=("odometry",))
PILOT = Feed(driver="mavlink", port="socket://rov:1", provides=("odometry",))


def line(body: str) -> bytes:
    total = 0
    for byte in body.encode():
        total ^= byte
    return f"${body}*{total:02X}\r\n".encode()


def dvpdl(ahead_m: float, right_m: float, dt_s: float = 0.2, confidence: int = 100) -> bytes:
    return line(f"DVPDL,373550,{dt_s * 1e6:.0f},0.001,-0.002,0.01,{ahead_m},{right_m},0.004,{confidence}")


def local_position(north_m: float, east_m: float, boot_ms: int) -> bytes:
    return struct.pack("<I6f", boot_ms, north_m, east_m, -1.0, 0.1, 0.1, 0.0)


def vision_delta(ahead_m: float, right_m: float, dt_s: float, confidence: float = 80.0) -> bytes:
    return struct.pack("<QQ7f", 10**9, round(dt_s * 1e6), 0.0, 0.0, 0.01, ahead_m, right_m, 0.2, confidence)


def run(feed: Feed, *said: bytes, site: Site | None = None) -> list[Odometry]:
    reader = NmeaReader(feed) if feed.driver == "nmea" else mavlink_reader(feed)
    decoder = FeedDecoder(feed, site or Site(), reader)
    readings: list[Reading] = []
    for number, data in enumerate(said):
        readings += decoder.push(number * SECOND // 5, data)
    assert all(isinstance(each, Odometry) for each in readings)
    return [each for each in readings if isinstance(each, Odometry)]


def test_a_velocity_log_tells_its_way_in_the_vehicle_s_axes() -> None:
    (reading,) = run(LOG, dvpdl(0.1, -0.02))
    assert (reading.dx_m, reading.dy_m, reading.dt_s, reading.in_vehicle) == pytest.approx((-0.02, 0.1, 0.2, True))
    assert reading.sd_m == pytest.approx(0.03 * math.hypot(0.1, 0.02) + 0.001 * 0.2)
    assert (reading.source, reading.quality) == ("feed:DVPDL", "good")
    # A log whose ahead points to starboard.
    (turned,) = run(LOG.model_copy(update={"mount_deg": 90.0}), dvpdl(0.1, -0.02))
    assert (turned.dx_m, turned.dy_m) == pytest.approx((0.1, 0.02))


def test_a_log_that_does_not_see_the_floor_is_bad_and_a_jump_too() -> None:
    readings = run(LOG, dvpdl(0.1, 0.0, confidence=0), dvpdl(4.0, 0.0), dvpdl(0.1, 0.0))
    assert [each.quality for each in readings] == ["bad", "bad", "good"]
    assert readings[1].reason == "a jump of 4.00 m in 0.20 s"
    assert [is_usable(each) for each in readings] == [False, False, True]
    assert run(LOG, dvpdl(0.1, 0.0, dt_s=0.0), line("DVPDL,1,200000,0,0,0,,,0,50")) == []


def test_an_autopilot_tells_places_and_two_of_them_are_a_way() -> None:
    said = [mavlink2(32, local_position(10.0 + 0.1 * n, -3.0 + 0.05 * n, 1000 + 200 * n)) for n in range(3)]
    readings = run(PILOT, *said)
    assert [each.in_vehicle for each in readings] == [False, False]
    assert (readings[1].dx_m, readings[1].dy_m) == pytest.approx((0.05, 0.1), abs=1e-5)
    assert readings[1].dt_s == pytest.approx(0.2)
    # Its north is the compass's: the way turns with the declination as headings do.
    (turned, _) = run(PILOT, *said, site=Site(declination_deg=90.0))
    assert (turned.dx_m, turned.dy_m) == pytest.approx((0.1, -0.05), abs=1e-5)


def test_an_autopilot_that_begins_anew_gives_no_way() -> None:
    places = [(10.0, 5000), (10.1, 5200), (0.0, 300), (0.1, 500), (40.0, 700)]
    readings = run(PILOT, *(mavlink2(32, local_position(north_m, 0.0, ms)) for north_m, ms in places))
    assert [(round(each.dy_m, 2), each.quality) for each in readings] == [(0.1, "good"), (0.1, "good"), (39.9, "bad")]


def test_a_velocity_log_beside_the_autopilot() -> None:
    heartbeat = mavlink2(0, bytes.fromhex("000000000c03510403"))
    (reading,) = run(PILOT, heartbeat, mavlink2(11011, vision_delta(0.12, 0.01, 0.1), 1, 197))
    assert (reading.dx_m, reading.dy_m, reading.in_vehicle) == pytest.approx((0.01, 0.12, True))
    assert reading.source == "feed:VISION_POSITION_DELTA"
    (unsure,) = run(PILOT, heartbeat, mavlink2(11011, vision_delta(0.1, 0.0, 0.1, 0.0), 1, 197))
    assert unsure.quality == "bad"
    assert run(PILOT, heartbeat, mavlink2(11011, vision_delta(0.1, 0.0, 0.1), 7, 197)) == []


def test_who_does_not_ask_for_odometry_gets_none() -> None:
    assert run(LOG.model_copy(update={"provides": ("heading", "depth")}), dvpdl(0.1, 0.0)) == []
    (heard, *_) = identify([(0, dvpdl(0.1, 0.0) * 8)])
    assert heard.settings["provides"] == ["odometry"]
