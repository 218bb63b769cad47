"""A velocity log in an emulated dive: it drifts as it should, costs nothing where it is not, and places a tunnel."""

from __future__ import annotations

import math

import pytest

from config.schema import Config, Feed, Site
from daemon.pipeline import Pipeline
from drivers.decoders import feed_decoder
from drivers.readings import Odometry
from tools.bench.truth import dive_records, judge
from tools.emulator.dive import Dive, DiveOptions
from tools.emulator.feeds import FeedOptions
from tools.emulator.record import record
from tools.emulator.site import SITES

LOGGED = FeedOptions(baud=9600, odometry_hz=5.0)
FEED = Feed(baud=9600, provides=("heading", "depth", "odometry"))


def dive(stations: int, options: FeedOptions | None = None) -> Dive:
    return Dive(SITES["tunnel"](), 1, DiveOptions(stations=stations, feed=options or FeedOptions()))


def test_the_log_s_ways_add_up_to_the_true_one_within_its_drift() -> None:
    there = dive(2, LOGGED)
    decoder = feed_decoder(FEED, Site())
    ways = [
        reading
        for piece in record(there)
        if piece.port == "feed"
        for reading in decoder.push(piece.t_ns, piece.data)
        if isinstance(reading, Odometry)
    ]
    first, second = there.site.stops
    true_m = math.hypot(second.x_m - first.x_m, second.y_m - first.y_m)
    # The vehicle hardly turns on this way, so that its own axes do for the sum.
    led_m = math.hypot(sum(each.dx_m for each in ways), sum(each.dy_m for each in ways))
    assert led_m == pytest.approx(1.02 * true_m, rel=0.02)
    assert {each.quality for each in ways} == {"good"}
    assert sum(each.dt_s for each in ways) == pytest.approx((ways[-1].t_ns - ways[0].t_ns) / 1e9, abs=0.5)


def test_without_a_log_a_dive_is_byte_for_byte_what_it_was() -> None:
    said = [piece.data for piece in record(dive(1)) if piece.port == "feed"]
    assert not any(b"DVPDL" in data for data in said)
    other = [piece.data for piece in record(dive(1, FeedOptions(odometry_scale=2.0))) if piece.port == "feed"]
    assert said == other


@pytest.mark.parametrize("stations", [3, pytest.param(9, marks=pytest.mark.slow)])
def test_a_featureless_tunnel_is_placed_with_odometry(stations: int) -> None:
    there = dive(stations, LOGGED)
    config = Config(site=Site(name="tunnel"), feed=(FEED,))
    pipeline = Pipeline(config)
    for each in dive_records(there):
        pipeline.push(each)
    pipeline.finish()
    figures = judge(there, pipeline.state, config)
    assert (figures.placed, figures.wrong, figures.stray) == (stations, 0, 0)
    assert len(pipeline.state.stations) == stations, "one rest is one scan"
    assert figures.error_max_m < 0.3
    assert pipeline.state.stations[-1].covariance[0, 0] > 0.1**2, "it may slide, and says so"
