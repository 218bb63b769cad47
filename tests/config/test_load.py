from __future__ import annotations

import json
import tomllib
from collections.abc import Callable
from pathlib import Path

import pytest

from config.checks import is_loopback
from config.errors import ConfigError, InputError
from config.load import DEFAULT, load_config, read_config
from config.schema import Config, Feed
from tools.cli import main

Write = Callable[[str], Path]


@pytest.fixture
def write(tmp_path: Path) -> Write:
    def _write(text: str) -> Path:
        path = tmp_path / "dive.toml"
        path.write_text(text)
        return path

    return _write


def mistakes(path: Path) -> list[str]:
    with pytest.raises(ConfigError) as caught:
        load_config(path)
    return str(caught.value).splitlines()


def test_shipped_defaults_are_the_schema_s_defaults() -> None:
    assert load_config(None) == Config()


def uncommented() -> str:
    """The default file with its optional keys and its feed switched on."""
    lines = DEFAULT.read_text().splitlines()
    optional = [line.startswith("# ") and not line.startswith("#  ") for line in lines]
    keys = [
        line.removeprefix("# ") if free and (" = " in line or "[[" in line[:4]) else line
        for line, free in zip(lines, optional, strict=True)
    ]
    return "\n".join(line for line in keys if not line.startswith("#"))


def test_shipped_file_names_every_key() -> None:
    raw = tomllib.loads(uncommented())
    fields = Config.model_fields
    assert set(raw) == set(fields)
    for name in set(fields) - {"feed"}:
        assert set(raw[name]) == set(type(getattr(Config(), name)).model_fields), name
    assert Feed(**raw["feed"][0]) == Feed()
    without_default = {name for name, field in Feed.model_fields.items() if field.default is None}
    assert set(raw["feed"][0]) == set(Feed.model_fields) - without_default
    assert all(f"#   {name} = " in DEFAULT.read_text() for name in without_default)


def test_every_mistake_is_told_at_once(write: Write) -> None:
    lines = mistakes(
        write(
            '[site]\nwater = "salt"\nheigth_m = 2\n[sonar]\nrange_m = 1000\nbaud = "fast"\ncell_m = 0.1\n'
            '[[feed]]\ndriver = "nmae"\nprovides = ["heading", "speed"]\n[maap]\nx = 1\n'
        )
    )
    text = {line.split(": ")[1]: line for line in lines}
    assert text["site.water"].endswith("got 'salt', expected 'fresh' or 'sea' or a number from 900 to 1300")
    assert "did you mean 'height_m'?" in text["site.heigth_m"]
    assert text["sonar.range_m"].endswith("got 1000, expected a number from 0.3 to 300")
    assert text["sonar.baud"].endswith("got 'fast', expected a whole number from 1200 to 4000000")
    assert text["sonar.cell_m"].endswith("'cell_m' belongs to [map]")
    assert text["feed[0].driver"].endswith(
        "got 'nmae', expected 'nmea' or 'mavlink' or 'videoray_pro3' or 'videoray_pro4' or 'pressure'"
    )
    assert "feed[0].provides[1]" in text
    assert "did you mean 'map'?" in text["maap"]
    assert all("dive.toml: " in line for line in lines)
    assert len(lines) == len(text) == 8


@pytest.mark.parametrize(
    ("text", "key", "says"),
    [
        ('[[feed]]\nname = "sonar"\n', "feed[0].name", "the sonar has that name"),
        ('[[feed]]\nport = "/dev/a"\n[[feed]]\nport = "/dev/b"\n', "feed[1].name", "feed[0] has that name"),
        ('[sonar]\nport = "/dev/a"\n[[feed]]\nport = "/dev/a"\n', "feed[0].port", "sonar.port is the same device"),
        ("[sonar]\nsector_deg = [90, 90]\n", "sonar.sector_deg", "leave it out for a full circle"),
        ("[sonar]\nsector_deg = [-500, 90]\n", "sonar.sector_deg", "limits from -360 to 360"),
        ("[map]\noccupied_threshold = 0.5\nfree_threshold = 0.5\n", "map.free_threshold", "less than"),
        ('[publish]\nbind = "tcp://127.0.0.1:5556"\n', "publish.bind", "without port"),
        ("[publish]\nrequest_port = 5556\n", "publish.request_port", "another port"),
        ('[publish]\nbind = "tcp://0.0.0.0"\n', "publish.keys", "lacuna keygen"),
        ('[publish]\nkeys = "/nowhere"\n', "publish.keys", "server.key_secret"),
    ],
)
def test_conflicts_between_keys(write: Write, text: str, key: str, says: str) -> None:
    lines = mistakes(write(text))
    assert any(f": {key}: " in line and says in line for line in lines), lines


def test_a_link_and_its_target_are_one_port(write: Write, tmp_path: Path) -> None:
    device = tmp_path / "ttyUSB0"
    device.touch()
    link = tmp_path / "by-id"
    link.symlink_to(device)
    lines = mistakes(write(f'[sonar]\nport = "{device}"\n[[feed]]\nport = "{link}"\n'))
    assert len(lines) == 1
    assert "same device" in lines[0]


@pytest.mark.parametrize(
    ("content", "says"),
    [(b"[site\n", "broken TOML"), (b"\xff\xfe", "not UTF-8"), (b"[site]\n[site]\n", "broken TOML")],
)
def test_what_is_not_toml_is_one_line(tmp_path: Path, content: bytes, says: str) -> None:
    path = tmp_path / "dive.toml"
    path.write_bytes(content)
    (line,) = mistakes(path)
    assert says in line


def test_an_absent_file_is_no_input(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="cannot read"):
        read_config(tmp_path / "none.toml")


def test_an_empty_file_is_the_defaults(write: Write) -> None:
    assert load_config(write("")) == Config()


@pytest.mark.parametrize(
    ("bind", "inside"),
    [
        ("tcp://127.0.0.1", True),
        ("tcp://127.9.9.9", True),
        ("tcp://localhost", True),
        ("tcp://[::1]", True),
        ("tcp://*", False),
        ("tcp://0.0.0.0", False),
        ("tcp://eth0", False),
        ("tcp://127.0.0.1.example.org", False),
    ],
)
def test_loopback(bind: str, inside: bool) -> None:
    assert is_loopback(bind) is inside


def test_check_config_command(write: Write, capsys: pytest.CaptureFixture[str]) -> None:
    good = write("[site]\nname = 'pool'\n")
    assert main(["check-config", str(good)]) == 0
    assert "site pool" in capsys.readouterr().out
    bad = write("[sonar]\nrang_m = 5\n")
    assert main(["check-config", str(bad)]) == 78
    assert capsys.readouterr().err.count("\n") == 1
    assert main(["check-config", str(bad), "--json"]) == 78
    body = json.loads(capsys.readouterr().out)
    assert body["ok"] is False
    assert body["mistakes"][0]["key"] == "sonar.rang_m"
    assert main(["check-config", str(bad.with_name("absent.toml"))]) == 66


def test_conflicts_are_told_beside_wrong_keys(tmp_path: Path) -> None:
    path = tmp_path / "dive.toml"
    path.write_text(
        '[sonar]\nbaud = 12\nsector_deg = [10, 10]\n[publish]\nbind = "tcp://0.0.0.0"\n'
        '[[feed]]\nname = "a"\ndriver = "nmae"\nunit = "bar"\n[[feed]]\nname = "b"\nprovides = ["heeding", "depth"]\n'
        'port = "/dev/ttyUSB9"\nunit = "bar"\n'
    )
    config, mistakes = read_config(path)
    assert config is None
    # Nothing is said of what goes with a driver that is unknown.
    assert [each.key for each in mistakes] == [
        "sonar.baud", "feed[0].driver", "feed[1].provides[0]", "feed[1].unit", "sonar.sector_deg", "publish.keys",
    ]  # fmt: skip
