"""Checks that concern more than one key: what each key alone allows but the whole does not."""

from __future__ import annotations

import ipaddress
import os
import re
from collections.abc import Iterator
from pathlib import Path

from config.conflict import Conflict
from config.feed_checks import check_feed, is_udp
from config.schema import Config, Publish, Sonar


def check(config: Config) -> list[Conflict]:
    """Return every conflict of a configuration whose keys are right one by one."""
    return [
        *_feed_names(config),
        *_ports(config),
        *_water(config),
        *(conflict for number, feed in enumerate(config.feed) for conflict in check_feed(f"feed[{number}]", feed)),
        *check_sonar(config.sonar),
        *_thresholds(config),
        *_addresses(config.publish),
        *_keys(config.publish),
    ]


def is_loopback(bind: str) -> bool:
    """Return whether nothing beyond this machine can reach ``tcp://ADDRESS``."""
    host = bind.removeprefix("tcp://").strip("[]")
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def _feed_names(config: Config) -> Iterator[Conflict]:
    seen = {"sonar": "the sonar has that name"}
    for number, feed in enumerate(config.feed):
        key = f"feed[{number}].name"
        if feed.name in seen:
            yield Conflict(key, repr(feed.name), "a name of its own", f"{seen[feed.name]}; give each [[feed]] a name")
        seen.setdefault(feed.name, f"feed[{number}] has that name")


def _ports(config: Config) -> Iterator[Conflict]:
    """Two names of one device (a by-id link and its target) are the same port."""
    seen = {_device(config.sonar.port): "sonar.port"}
    if is_udp(config.sonar.port):
        yield Conflict("sonar.port", repr(config.sonar.port), "a port that can be written to")
    for number, feed in enumerate(config.feed):
        key = f"feed[{number}].port"
        other = seen.setdefault(_device(feed.port), key)
        if other != key:
            yield Conflict(key, repr(feed.port), "a port of its own", f"{other} is the same device")


def _water(config: Config) -> Iterator[Conflict]:
    site = config.site
    if site.gravity_m_s2 is not None and site.latitude_deg is not None:
        yield Conflict("site.gravity_m_s2", f"{site.gravity_m_s2:g}", "gravity_m_s2 or latitude_deg, not both")
    if site.temperature_c is not None and "sound_speed_m_s" in config.sonar.model_fields_set:
        got = f"{config.sonar.sound_speed_m_s:g}"
        yield Conflict("sonar.sound_speed_m_s", got, "sound_speed_m_s or site.temperature_c, not both")
    elif site.temperature_c is None and site.salinity_ppt is not None:
        yield Conflict("site.salinity_ppt", f"{site.salinity_ppt:g}", "temperature_c beside it, for the speed of sound")


def _device(port: str) -> str:
    return os.path.realpath(port) if port.startswith("/") else port


def check_sonar(sonar: Sonar) -> Iterator[Conflict]:
    """Yield the conflicts of how a head is to be set."""
    sector = sonar.sector_deg
    if sector is None:
        return
    left, right = sector
    if not (-360 <= left <= 360 and -360 <= right <= 360):
        yield Conflict("sonar.sector_deg", f"[{left:g}, {right:g}]", "limits from -360 to 360")
    elif (right - left) % 360 < sonar.step_deg:
        yield Conflict(
            "sonar.sector_deg",
            f"[{left:g}, {right:g}]",
            "a sector wider than step_deg",
            "leave it out for a full circle",
        )


def _thresholds(config: Config) -> Iterator[Conflict]:
    if config.map.free_threshold >= config.map.occupied_threshold:
        yield Conflict("map.free_threshold", f"{config.map.free_threshold:g}", "less than map.occupied_threshold")


def _addresses(publish: Publish) -> Iterator[Conflict]:
    if re.search(r":\d+$", publish.bind.strip()) and not publish.bind.endswith("]") and publish.bind.count(":") == 2:
        yield Conflict("publish.bind", repr(publish.bind), "an address without port", "the ports are keys of their own")
    if publish.port == publish.request_port:
        yield Conflict("publish.request_port", str(publish.request_port), "another port than publish.port")


def _keys(publish: Publish) -> Iterator[Conflict]:
    if publish.keys is None:
        if not is_loopback(publish.bind):
            yield Conflict(
                "publish.keys", "nothing", f"a folder of keys, because {publish.bind} is not loopback",
                "make one with 'lacuna keygen DIR', or bind tcp://127.0.0.1",
            )  # fmt: skip
        return
    folder = Path(publish.keys)
    for name in ("server.key_secret", "authorized"):
        if not (folder / name).exists():
            yield Conflict(
                "publish.keys", repr(publish.keys), f"a folder with {name} in it", "make one with 'lacuna keygen DIR'"
            )
