"""The emulated compass and depth sensor as the NMEA decoder hears them."""

from __future__ import annotations

from math import degrees, radians

import numpy as np
import pytest

from config.schema import Feed, Site
from drivers.decoders import feed_decoder
from drivers.readings import Depth, Heading, Reading
from tools.emulator.echoes import Place
from tools.emulator.feeds import FeedOptions, NmeaFeed
from tools.emulator.line import Line

MS = 1_000_000


def listen(options: FeedOptions, heading_deg: float, seconds: float = 20.0) -> tuple[list[Reading], int]:
    place = Place(0.0, 0.0, 1.3, radians(heading_deg))
    feed = NmeaFeed(lambda _: place, np.random.default_rng(3), options)
    decoder = feed_decoder(Feed(), Site())
    readings: list[Reading] = []
    count = 0
    for step in range(1, int(seconds * 100) + 1):
        data = feed.tick(step * 10 * MS)
        count += len(data)
        readings += decoder.push(step * 10 * MS, data)
    assert not decoder.counters.bad
    return readings, count


def headings(readings: list[Reading]) -> np.ndarray:
    return np.array([degrees(each.heading_rad) for each in readings if isinstance(each, Heading)])


def test_rates_noise_and_pace() -> None:
    readings, count = listen(FeedOptions(bias_deg=0.0, deviation_deg=0.0), 120.0)
    compass = headings(readings)
    depths = np.array([each.depth_m for each in readings if isinstance(each, Depth)])
    assert len(compass) / 20.0 == pytest.approx(10.0, rel=0.1)
    assert len(depths) / 20.0 == pytest.approx(5.0, rel=0.1)
    assert compass.mean() == pytest.approx(120.0, abs=0.1)
    assert compass.std() == pytest.approx(0.3, abs=0.08)
    assert depths.mean() == pytest.approx(1.3, abs=0.01)
    assert count <= 20 * 480, "4800 baud carry 480 bytes a second"


@pytest.mark.parametrize("sentence", ["HDG", "HDM"])
def test_bias_deviation_and_declination_add_up(sentence: str) -> None:
    options = FeedOptions(
        sentence="HDM" if sentence == "HDM" else "HDG",
        bias_deg=2.0,
        deviation_deg=3.0,
        deviation_at_deg=60.0,
        declination_deg=4.0,
        heading_sd_deg=0.0,
    )
    assert headings(listen(options, 60.0, 2.0)[0])[0] == pytest.approx(60.0 - 4.0 + 2.0 + 3.0, abs=0.051)
    assert headings(listen(options, 240.0, 2.0)[0])[0] == pytest.approx(240.0 - 4.0 + 2.0 - 3.0, abs=0.051)


def test_north_is_written_as_zero_not_as_360() -> None:
    compass = headings(listen(FeedOptions(bias_deg=0.0, deviation_deg=0.0), 0.0)[0])
    assert compass.min() >= 0.0
    assert compass.max() < 360.0
    assert {round(value) % 360 for value in compass} <= {0, 1, 359}


def test_a_line_delivers_every_byte_once_at_its_pace() -> None:
    line = Line(4800)
    sent = bytes(range(256)) * 2
    line.send(0, sent[:300])
    line.send(10 * MS, sent[300:])
    got, sizes = b"", []
    for step in range(1, 200):
        piece = line.take(step * 7 * MS)
        got += piece
        sizes.append(len(piece))
    assert got == sent
    assert max(sizes) <= 4
