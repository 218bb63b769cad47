"""Read a configuration file: every mistake at once, each with its key, what it got and what it expected."""

from __future__ import annotations

import copy
import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from config.checks import check
from config.errors import ConfigError, InputError
from config.expected import expected, nearest
from config.schema import Config
from config.water import site_sound_speed_m_s

DEFAULT: Final = Path(__file__).with_name("default.toml")


@dataclass(frozen=True, slots=True)
class Mistake:
    """One mistake: ``key`` with dots (``feed[0].baud``), ``got`` as text, ``expected`` as text, ``hint`` or empty."""

    file: str
    key: str
    got: str
    expected: str
    hint: str = ""

    def __str__(self) -> str:
        """Return the line that the operator reads."""
        where = f"{self.file}: {self.key}" if self.key else self.file
        return f"{where}: got {self.got}, expected {self.expected}" + (f"; {self.hint}" if self.hint else "")


def load_config(path: Path | None) -> Config:
    """Return the configuration of ``path`` (None: the defaults that ship with lacuna).

    Raises InputError where the file cannot be read and ConfigError, one line a mistake, where it is wrong.
    """
    config, mistakes = read_config(path or DEFAULT)
    if config is None or mistakes:
        raise ConfigError("\n".join(str(each) for each in mistakes))
    return config


def read_config(path: Path) -> tuple[Config | None, list[Mistake]]:
    """Return the configuration and its mistakes; it is None where the mistakes leave nothing to return."""
    try:
        raw = tomllib.loads(path.read_bytes().decode("utf-8"))
    except OSError as error:
        raise InputError(f"cannot read {path}: {error.strerror}; name a configuration file that exists") from None
    except UnicodeDecodeError as error:
        return None, [Mistake(str(path), "", f"a byte that is not UTF-8 at {error.start}", "UTF-8 text")]
    except tomllib.TOMLDecodeError as error:
        return None, [Mistake(str(path), "", f"broken TOML ({error})", "key = value lines under [section] lines")]
    return _validated(str(path), raw)


def _validated(file: str, raw: dict[str, Any]) -> tuple[Config | None, list[Mistake]]:
    try:
        config = Config.model_validate(raw)
    except ValidationError as error:
        mistakes = _from_pydantic(file, raw, error)
        return None, [*mistakes, *_conflicts_of_the_rest(file, raw, error)]
    found = _conflicts(file, config)
    return (None if found else _with_sound_speed(config)), found


def _conflicts(file: str, config: Config) -> list[Mistake]:
    return [Mistake(file, each.key, each.got, each.expected, each.hint) for each in check(config)]


def _conflicts_of_the_rest(file: str, raw: dict[str, Any], error: ValidationError) -> list[Mistake]:
    """Conflicts between the keys that are right one by one, so that nobody has to mend a file in two rounds."""
    rest, wrong = copy.deepcopy(raw), [_resolve(raw, each["loc"])[0] for each in _told(error)]
    for place in sorted(wrong, key=len, reverse=True):
        _drop(rest, place)
    # What goes with an unknown driver is unknown, and a default that stands for a wrong key is nobody's mistake.
    unknown = tuple(f"{_dotted(place[:-1])}." for place in wrong if place and place[-1] == "driver")
    told = {_dotted(place) for place in wrong}
    try:
        config = Config.model_validate(rest)
    except ValidationError:
        return []  # what is left has no sense without what is wrong
    found = _conflicts(file, config)
    return [each for each in found if each.key not in told and not each.key.startswith(unknown or ("-",))]


def _drop(raw: dict[str, Any], place: tuple[int | str, ...]) -> None:
    """Remove a key, or the key of the list that holds a wrong element."""
    while place and isinstance(place[-1], int):
        place = place[:-1]
    inside: Any = raw
    for step in place[:-1]:
        inside = inside[step]
    if place:
        inside.pop(place[-1], None)


def _with_sound_speed(config: Config) -> Config:
    """Let the site's temperature, where it is told, set the speed of sound (`config.water`)."""
    speed_m_s = site_sound_speed_m_s(config.site)
    if speed_m_s is None:
        return config
    sonar = config.sonar.model_copy(update={"sound_speed_m_s": round(speed_m_s, 2)})
    return config.model_copy(update={"sonar": sonar})


def _from_pydantic(file: str, raw: dict[str, Any], error: ValidationError) -> list[Mistake]:
    """One mistake a key: the branches of a union, told apart by pydantic, are one mistake to a person."""
    mistakes: dict[str, Mistake] = {}
    for each in _told(error):
        place, value = _resolve(raw, each["loc"])
        key = _dotted(place)
        if each["type"] == "extra_forbidden":
            offered, hint = nearest(place)
            mistakes[key] = Mistake(file, key, "an unknown key", offered, hint)
        else:
            mistakes.setdefault(key, Mistake(file, key, _shown(value), expected(place)))
    return list(mistakes.values())


def _told(error: ValidationError) -> list[ErrorDetails]:
    """Leave out the errors of keys that are left out and hang on one that is wrong."""
    return [each for each in error.errors(include_url=False) if each["type"] != "default_factory_not_called"]


def _resolve(raw: dict[str, Any], loc: tuple[int | str, ...]) -> tuple[tuple[int | str, ...], Any]:
    """Return the part of ``loc`` that stands in the file (pydantic appends branch names) and its value."""
    value: Any = raw
    place: list[int | str] = []
    for step in loc:
        inside = (isinstance(value, dict) and step in value) or (
            isinstance(value, list) and isinstance(step, int) and step < len(value)
        )
        if not inside:
            break
        value = value[step]
        place.append(step)
    return tuple(place), value


def _dotted(place: tuple[int | str, ...]) -> str:
    return "".join(f"[{step}]" if isinstance(step, int) else f".{step}" for step in place).lstrip(".")


def _shown(value: object) -> str:
    text = repr(value).lower() if isinstance(value, bool) else repr(value)
    return text if len(text) <= 60 else f"{text[:57]}..."
