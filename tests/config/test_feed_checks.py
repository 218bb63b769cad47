"""What goes together in a [[feed]], and what of a site sets gravity and the speed of sound."""

from __future__ import annotations

from pathlib import Path

import pytest

from config.load import load_config, read_config
from config.schema import BAUDS, Config, Feed, Site
from config.water import gravity_m_s2, site_sound_speed_m_s, sound_speed_m_s


def mistakes(folder: Path, text: str) -> dict[str, str]:
    path = folder / "dive.toml"
    path.write_text(text)
    return {each.key: str(each) for each in read_config(path)[1]}


@pytest.mark.parametrize(
    ("feed", "key", "says"),
    [
        ('driver = "mavlink"\nchecksum = "warn"', "checksum", "no such key with mavlink; it is for nmea"),
        ('driver = "mavlink"\nunit = "bar"', "unit", "it is for pressure"),
        ('driver = "nmea"\npoll = true', "poll", "it is for videoray_pro4 and pressure"),
        ('driver = "nmea"\nangle_unit = "tenth_deg"', "angle_unit", "auto, deg, bam16, mil with nmea"),
        ('driver = "videoray_pro4"\nangle_unit = "mil"', "angle_unit", "auto, deg, tenth_deg with videoray_pro4"),
        ('driver = "pressure"\nprovides = ["heading"]', "provides", "of depth, which pressure tells"),
        ('driver = "mavlink"\nprovides = ["altitude"]', "provides", "of heading, depth, odometry, which mavlink tells"),
        ("provides = []", "provides", "at least one of heading, depth, altitude, odometry; or leave the feed out"),
        ('driver = "videoray_pro3"', "depth_points", 'or set provides = ["heading"]'),
        ('driver = "videoray_pro3"\ndepth_points = [[5, 0], [5, 9]]', "depth_points", "two different counts"),
        ('driver = "videoray_pro3"\ndepth_points = [[5, 0], [1024, 9]]', "depth_points", "from 0 to 1023"),
        ("deviation_deg = [[0, 1], [0, 2]]", "deviation_deg", "each once"),
        ("deviation_deg = [[360, 1]]", "deviation_deg", "from 0 to below 360"),
        ("deviation_deg = [[1, 181]]", "deviation_deg", "from -180 to 180"),
        ('driver = "pressure"\npoll = true', "poll", "such sensors speak by themselves"),
        ('driver = "videoray_pro4"\nport = "udp://:1"\npoll = true', "poll", "only listens"),
        ('port = "udp://:x"', "port", "udp://:PORT (this machine) or udp://ADDRESS:PORT"),
        ('port = "udp:14550"', "port", "udp://:PORT"),
        ('talker = "hc"', "talker", "like ^[A-Z]{2}$"),
        ("max_turn_deg_s = 0", "max_turn_deg_s", "got 0"),
        ("surface_mbar = 10", "surface_mbar", "from 500 to 1200"),
        ("stale_after_s = -1", "stale_after_s", "got -1"),
        ('driver = "pressure"\nunit = "mb"', "unit", "'mbar' or 'hpa'"),
    ],
)
def test_what_does_not_go_together_is_one_clear_line(tmp_path: Path, feed: str, key: str, says: str) -> None:
    found = mistakes(tmp_path, f"[[feed]]\n{feed}\n")
    assert list(found) == [f"feed[0].{key}"]
    assert says in found[f"feed[0].{key}"]
    assert "\n" not in found[f"feed[0].{key}"]


@pytest.mark.parametrize(
    "feed",
    [
        'driver = "mavlink"\nport = "udp://:14550"\nsystem = 1\nheading_from = "vfr_hud"',
        'driver = "videoray_pro3"\ndepth_points = [[1017, 0.0], [313, 34.2]]',
        'driver = "videoray_pro3"\nprovides = ["heading"]',
        'driver = "videoray_pro4"\npoll = true\nangle_unit = "deg"',
        'driver = "pressure"\nunit = "psi"\ncolumn = 3\npressure = "gauge"',
        'driver = "pressure"\nformat = "keller"\npoll = true\naddress = 3',
        'talker = "HC"\ndeviation_deg = [[0, 1.2], [90, -0.3]]\nxdr_pressure_names = ["PRESS"]\npressure = "gauge"',
    ],
)
def test_what_goes_together(tmp_path: Path, feed: str) -> None:
    assert mistakes(tmp_path, f"[[feed]]\n{feed}\n") == {}


def test_baud_and_quantities_are_those_of_the_driver_and_stay_in_the_log_s_header() -> None:
    for driver, baud in BAUDS.items():
        feed = Feed.model_validate({"driver": driver})
        assert feed.baud == baud
        assert feed.provides == (("depth",) if driver == "pressure" else ("heading", "depth"))
        assert Feed.model_validate_json(feed.model_dump_json()) == feed
    assert Feed.model_validate({"driver": "mavlink", "baud": 115200}).baud == 115200


def test_gravity_is_configured_or_by_latitude() -> None:
    assert gravity_m_s2(Site()) == 9.80665
    assert gravity_m_s2(Site(gravity_m_s2=9.81)) == 9.81
    # Normal gravity of WGS 84 at the equator, at the pole, and at Malta.
    assert gravity_m_s2(Site(latitude_deg=0)) == pytest.approx(9.7803253, abs=1e-6)
    assert gravity_m_s2(Site(latitude_deg=-90)) == pytest.approx(9.8321849, abs=1e-6)
    assert gravity_m_s2(Site(latitude_deg=35.9)) == pytest.approx(9.7981, abs=5e-5)


@pytest.mark.parametrize(
    ("temperature_c", "salinity_ppt", "speed_m_s"),
    # Del Grosso and Mader in pure water (1402.4, 1447.3, 1482.3, 1509.1 m/s), Mackenzie in the sea (1521.5, 1500.1).
    [(0, 0, 1402.4), (10, 0, 1447.3), (20, 0, 1482.3), (30, 0, 1509.1), (20, 35, 1521.5), (13, 35, 1500.1)],
)
def test_speed_of_sound_agrees_with_other_formulas(temperature_c: float, salinity_ppt: float, speed_m_s: float) -> None:
    assert sound_speed_m_s(temperature_c, salinity_ppt) == pytest.approx(speed_m_s, abs=1.0)


def test_the_site_s_temperature_sets_the_speed_of_sound(tmp_path: Path) -> None:
    path = tmp_path / "dive.toml"
    path.write_text("[site]\ntemperature_c = 12\n")
    config = load_config(path)
    assert config.sonar.sound_speed_m_s == pytest.approx(1454.28)
    assert Config.model_validate_json(config.model_dump_json()).sonar == config.sonar
    assert site_sound_speed_m_s(Site()) is None
    assert site_sound_speed_m_s(Site(temperature_c=20, water="sea")) == sound_speed_m_s(20, 35)
    assert site_sound_speed_m_s(Site(temperature_c=20, salinity_ppt=38)) == sound_speed_m_s(20, 38)


@pytest.mark.parametrize(
    ("text", "key", "says"),
    [
        ("[site]\ngravity_m_s2 = 9.8\nlatitude_deg = 36\n", "site.gravity_m_s2", "not both"),
        ("[site]\ntemperature_c = 12\n[sonar]\nsound_speed_m_s = 1500.0\n", "sonar.sound_speed_m_s", "not both"),
        ("[site]\nsalinity_ppt = 38\n", "site.salinity_ppt", "temperature_c beside it"),
        ('[sonar]\nport = "udp://:5"\n', "sonar.port", "can be written to"),
    ],
)
def test_two_answers_to_one_question_are_refused(tmp_path: Path, text: str, key: str, says: str) -> None:
    assert says in mistakes(tmp_path, text)[key]
