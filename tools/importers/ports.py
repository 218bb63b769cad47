"""From the lines of a foreign recording to the ports of a log, and the configuration that says what they are."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Any, Final

from pydantic import ValidationError

from config.errors import DataError, UsageError
from config.schema import Config, Feed, Sonar
from drivers.decoders import FEEDS, SONAR_PORT, SONARS
from drivers.tritech import units
from drivers.tritech.headdata import Control, HeadData
from tools.importers.lines import SONAR_DRIVER, LineProbe, Survey

DRIVERS: Final = (*SONARS, *FEEDS)


@dataclass(frozen=True, slots=True)
class Ports:
    """Port name of each line, the driver of each port (None: nothing understands it), and the configuration."""

    names: dict[str, str]
    drivers: dict[str, str | None]
    config: Config


def assign(survey: Survey, told: Mapping[str, str], base: Config, baud: int, feed_baud: int) -> Ports:
    """Give each line a port: ``sonar`` to the sonar with most pings, feeds theirs of ``base`` or ``feed``, ``feed2``...

    ``told`` has the driver of lines that the operator knows.  A line that nothing understands is kept as ``other``.
    Raises UsageError where ``told`` does not fit, DataError where nothing is understood.
    """
    _check(survey, told)
    drivers = {name: told.get(name, probe.driver) for name, probe in survey.lines.items()}
    if not any(drivers.values()):
        lines = ", ".join(survey.lines) or "none"
        raise DataError(
            f"no sonar and no feed in the recording (lines: {lines}); say what they are: --port NAME=DRIVER"
        )
    sonar = _sonar_line(survey, drivers)
    names: dict[str, str] = {} if sonar is None else {sonar: SONAR_PORT}
    feeds: list[Feed] = []
    for line, probe in survey.lines.items():
        driver = drivers[line]
        if driver in FEEDS:
            feeds.append(_feed(probe, driver, base.feed, feeds, feed_baud))
            names[line] = feeds[-1].name
        elif line != sonar:
            names[line] = _free("other", names.values())
    config = base.model_copy(update={"feed": tuple(feeds)})
    if sonar is not None:
        config = config.model_copy(update={"sonar": _sonar(base.sonar, survey.lines[sonar], baud)})
    understood = {SONAR_PORT, *(feed.name for feed in feeds)}
    by_port = {port: drivers[line] if port in understood else None for line, port in names.items()}
    return Ports(names, by_port, config)


def _check(survey: Survey, told: Mapping[str, str]) -> None:
    for name, driver in told.items():
        if name not in survey.lines:
            raise UsageError(f"--port {name}={driver}: no such line; the recording has {', '.join(survey.lines)}")
        if driver not in DRIVERS:
            raise UsageError(f"--port {name}={driver}: no such driver; choose one of {', '.join(DRIVERS)}")


def _sonar_line(survey: Survey, drivers: Mapping[str, str | None]) -> str | None:
    sonars = [probe for name, probe in survey.lines.items() if drivers[name] in SONARS]
    return max(sonars, key=lambda probe: probe.pings).name if sonars else None


def _feed(probe: LineProbe, driver: str, known: tuple[Feed, ...], used: list[Feed], baud: int) -> Feed:
    """Return the operator's own feed of the line's name, or the next one that is free, or one made from the line."""
    taken = {feed.name for feed in used}
    free = [feed for feed in known if feed.name not in taken and feed.driver == driver]
    chosen = next((feed for feed in free if feed.name == probe.name), free[0] if free else None)
    if chosen is not None:
        return chosen.model_copy(update={"port": f"import:{probe.name}"})
    return probe.feed(_free("feed", taken), driver, baud)


def _free(stem: str, taken: Collection[str]) -> str:
    names = [stem, *(f"{stem}{number}" for number in range(2, len(taken) + 3))]
    return next(name for name in names if name not in taken)


def _sonar(base: Sonar, probe: LineProbe, baud: int) -> Sonar:
    """Return ``base`` with what the head's first ping tells, except where the operator has set it."""
    found: dict[str, Any] = {"port": f"import:{probe.name}", "baud": baud}
    if probe.head is not None:
        found |= _head(*probe.head)
    settings = base.model_dump(include=base.model_fields_set - {"port"})
    for key, value in found.items():
        try:
            settings = Sonar.model_validate({key: value} | settings).model_dump(include={key, *settings})
        except ValidationError:
            # A setting that no configuration may have (1400 bins, say) says nothing that the pings do not.
            continue
    return Sonar.model_validate(settings)


def _head(node: int, data: HeadData) -> dict[str, Any]:
    found: dict[str, Any] = {
        "driver": SONAR_DRIVER,
        "node": node,
        "head_type": "dst" if data.device_type == 0x11 else "non-dst",
        "range_m": units.labelled_range_m(data.range_scale),
        "bins": len(data.bins) if Control.ADC_8_ON in data.control else 2 * len(data.bins),
        "bits": 8 if Control.ADC_8_ON in data.control else 4,
        "step_deg": data.step * 360.0 / units.TURN,
        "gain_pct": round(units.gain_pct(data.gain), 2),
    }
    if Control.CONTINUOUS not in data.control:
        found["sector_deg"] = tuple(_signed_deg(limit) for limit in (data.left_limit, data.right_limit))
    return found


def _signed_deg(limit: int) -> float:
    turned = math.degrees(units.angle_rad(limit))
    return round(turned - 360.0 if turned > 180.0 else turned, 4)
