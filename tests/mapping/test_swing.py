from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
import pytest

from config.schema import Map
from daemon.swing import compass_facts
from drivers.readings import Heading, Reading
from mapping.mapper import Mapper
from mapping.prior import DISTURBED_SD_RAD, Prior
from mapping.scan import ScanBuilder
from mapping.swing import is_turned, swing_of, swung
from mapping.values import Scan, Station
from tests.mapping.rooms import KEYHOLE, Stay, pings

STAYS = [
    Stay(0.3, -0.5, 0.4, 330),
    Stay(0.1, 0.6, 2.0, 330, glide=200),
    Stay(0.1, 2.0, 3.4, 330, glide=250),
    Stay(0.2, 3.4, 4.6, 330, glide=250),
    Stay(0.6, 4.9, 5.9, 330, glide=280),
    Stay(1.6, 5.0, 0.9, 330, glide=250),
]


def curve(read: np.ndarray) -> np.ndarray:
    """A bias, and deviations of 4 degrees and of 1, to be added to a heading as read."""
    return np.asarray(np.radians(2.0 + 4.0 * np.sin(read + 0.7) + np.cos(2.0 * read)))


def test_bias_and_deviation_are_found_with_their_uncertainty() -> None:
    rng = np.random.default_rng(3)
    read = rng.uniform(0.0, math.tau, 14)
    swing = swung(list(read), list(read + curve(read) + rng.normal(0.0, math.radians(0.5), 14)))
    assert math.degrees(swing.bias_rad) == pytest.approx(-2.0, abs=3.0 * math.degrees(swing.bias_sd_rad))
    assert math.degrees(swing.bias_sd_rad) < 0.6
    assert math.degrees(swing.deviation_rad[0]) == pytest.approx(4.8, abs=0.8)
    add, sd = swing.at(1.0)
    assert add == pytest.approx(float(curve(np.array(1.0))), abs=3.0 * sd)


def test_iron_nearby_does_not_bend_the_curve_and_is_told() -> None:
    read = np.arange(12) * math.tau / 12.0
    heading = read + curve(read)
    heading[[4, 5, 6]] += math.radians(30.0)
    swing = swung(list(read), list(heading % math.tau))
    np.testing.assert_array_equal(np.flatnonzero(swing.is_disturbed), [4, 5, 6])
    assert math.degrees(swing.bias_rad) == pytest.approx(-2.0, abs=1.0)
    assert math.degrees(swing.deviation_rad[0]) == pytest.approx(4.8, abs=1.2)


def test_a_piece_with_axes_of_its_own_has_the_same_curve() -> None:
    read = np.arange(12) * math.tau / 12.0
    swing = swung(list(read), list(read + curve(read) + 3.0))
    assert swing.at(0.5)[0] == pytest.approx(3.0 + float(curve(np.array(0.5))), abs=math.radians(1.0))
    assert not swing.is_disturbed.any()


def test_nothing_is_known_without_stations() -> None:
    swing = swung([], [])
    assert swing.at(1.0)[0] == 0.0
    assert math.degrees(swing.at(1.0)[1]) > 4.0
    assert compass_facts([]) is None


def test_a_prior_knows_that_iron_turns_a_compass_and_that_there_may_be_none() -> None:
    prior = Prior(0.0, 0.0, 1.0, 1.0, math.radians(4.0))
    turned = np.array([[0.0, 0.0, 1.0 + math.radians(30.0)]])
    assert replace(prior, disturbed=True).log_density(turned)[0] > prior.log_density(turned)[0] + 10.0
    assert np.std(replace(prior, disturbed=True).draw(2000, np.random.default_rng(1))[:, 2]) > 0.8 * DISTURBED_SD_RAD
    none = replace(prior, heading_sd_rad=math.inf)
    assert none.log_density(turned)[0] == none.log_density(np.array([[0.0, 0.0, 4.0]]))[0]
    assert np.ptp(none.draw(500, np.random.default_rng(1))[:, 2]) > 6.0
    assert is_turned(1.2, prior)
    assert not is_turned(1.02, prior)
    assert not is_turned(4.0, none)


def dive(alter: Callable[[Heading], Heading | None]) -> list[Scan]:
    scans = ScanBuilder(Map())
    return [scan for reading in altered(alter) for scan in scans.push(reading)] + scans.finish()


def altered(alter: Callable[[Heading], Heading | None]) -> Iterator[Reading]:
    for reading in pings(KEYHOLE, STAYS, np.random.default_rng(3)):
        told = alter(reading) if isinstance(reading, Heading) else reading
        if told is not None:
            yield told


def mapped(scans: list[Scan]) -> tuple[Station, ...]:
    mapper = Mapper(Map())
    for scan in scans:
        mapper.step(scan)
    return mapper.stations


def errors_m(stations: tuple[Station, ...]) -> list[float]:
    """Errors of the placed stations after the turn and the shift that suit them best."""
    told = [(s.pose, stay) for s, stay in zip(stations, STAYS, strict=True) if s.status == "placed"]
    found = np.array([complex(p.x_m, p.y_m) for p, _ in told])
    true = np.array([complex(stay.x_m, stay.y_m) for _, stay in told])
    found, true = found - found.mean(), true - true.mean()
    turn = np.vdot(found, true) / max(abs(np.vdot(found, true)), 1e-9)
    return [float(abs(e)) for e in found * turn - true]


@pytest.mark.slow
def test_a_compass_that_deviates_by_four_degrees_is_seen_through() -> None:
    def deviating(reading: Heading) -> Heading:
        return replace(reading, heading_rad=reading.heading_rad - float(curve(np.array(reading.heading_rad))))

    stations = mapped(dive(deviating))
    assert [s.status for s in stations] == ["placed"] * 6
    assert max(errors_m(stations)) < 0.1
    swing, told = swing_of(stations)
    assert len(told) == 6
    assert math.degrees(swing.deviation_rad[0]) == pytest.approx(4.8, abs=2.0)
    facts = compass_facts(stations)
    assert facts is not None
    assert facts["stations"] == 6
    assert facts["disturbed"] == []


@pytest.mark.slow
def test_a_zone_of_disturbed_compass_does_not_bend_the_map() -> None:
    gone_ns = 50_000_000

    def near_iron(reading: Heading) -> Heading:
        begin = (330 + 200 + 330 + 100) * gone_ns
        end = begin + (150 + 330 + 250 + 330 + 280 + 330 + 100) * gone_ns
        off = math.radians(30.0) if begin <= reading.t_ns < end else 0.0
        return replace(reading, heading_rad=(reading.heading_rad + off) % math.tau)

    stations = mapped(dive(near_iron))
    assert sum(s.status == "placed" for s in stations) >= 3
    assert max(errors_m(stations)) < 0.12


@pytest.mark.slow
def test_without_a_compass_scans_are_placed_where_rooms_allow_and_none_is_wrong() -> None:
    scans = dive(lambda _: None)
    assert not any(scan.has_compass for scan in scans)
    stations = mapped(scans)
    assert sum(s.status == "placed" for s in stations) >= 3
    assert max(errors_m(stations)) < 0.12
    assert compass_facts(stations) is None
