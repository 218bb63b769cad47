"""One fault, and the files that hold them."""

from __future__ import annotations

import json
import tomllib
from dataclasses import dataclass
from math import inf
from pathlib import Path
from typing import Any, Final, Literal, get_args

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from config.errors import DataError, InputError

Port = Literal["sonar", "feed"]
Kind = Literal[
    "hangup",
    "stall",
    "half_frame",
    "garbage",
    "drop",
    "double",
    "flip",
    "baud",
    "power_cut",
    "power_loss",
    "motor_error",
    "stale",
    "jump",
    "clock_step",
]

PORTS: Final[tuple[Port, ...]] = get_args(Port)
_TIMES: Final = frozenset({"kind", "port", "at_s", "every_s"})


@dataclass(frozen=True, slots=True)
class _Shape:
    """What a kind of fault may befall, the keys of its own, and how long it lasts where that is not told."""

    ports: tuple[Port, ...]
    keys: frozenset[str]
    for_s: float = 0.0


_ANY_PORT: Final = PORTS
_SHAPES: Final[dict[Kind, _Shape]] = {
    "hangup": _Shape(_ANY_PORT, frozenset({"for_s"}), 5.0),
    "stall": _Shape(_ANY_PORT, frozenset({"for_s"}), 2.0),
    "half_frame": _Shape(_ANY_PORT, frozenset({"for_s"})),
    "garbage": _Shape(_ANY_PORT, frozenset({"count"})),
    "drop": _Shape(_ANY_PORT, frozenset({"rate", "for_s"}), inf),
    "double": _Shape(_ANY_PORT, frozenset({"rate", "for_s"}), inf),
    "flip": _Shape(_ANY_PORT, frozenset({"rate", "for_s"}), inf),
    "baud": _Shape(_ANY_PORT, frozenset({"baud", "for_s"}), inf),
    "power_cut": _Shape(("sonar",), frozenset({"for_s"}), 2.0),
    "power_loss": _Shape(("sonar",), frozenset()),
    "motor_error": _Shape(("sonar",), frozenset({"turn_deg"})),
    "stale": _Shape(("feed",), frozenset({"for_s"}), 10.0),
    "jump": _Shape(("feed",), frozenset({"heading_deg", "depth_m", "for_s"}), 5.0),
    "clock_step": _Shape((), frozenset({"step_s"})),
}


class Fault(BaseModel):
    """Something that goes wrong, once ``at_s`` or again and again (package docstring)."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    kind: Kind
    port: Port | None = None
    at_s: float | None = Field(None, ge=0)
    every_s: float | None = Field(None, gt=0)
    for_s: float | None = Field(None, ge=0)
    rate: float = Field(0.01, gt=0, le=1)
    count: int = Field(200, ge=1, le=100_000)
    baud: int = Field(9600, ge=300, le=4_000_000)
    turn_deg: float = Field(20.0, ge=-180, le=180)
    heading_deg: float = Field(0.0, ge=-360, le=360)
    depth_m: float = Field(0.0, ge=-1000, le=1000)
    step_s: float = Field(3600.0)

    @model_validator(mode="after")
    def _fits_its_kind(self) -> Fault:
        shape = _SHAPES[self.kind]
        if (self.at_s is None) == (self.every_s is None):
            raise ValueError("needs a time: either at_s or every_s")
        if strange := self.model_fields_set - shape.keys - _TIMES:
            raise ValueError(f"{self.kind} has no {', '.join(sorted(strange))}")
        if self.port is None and len(shape.ports) > 1:
            raise ValueError(f"{self.kind} needs a port: {' or '.join(shape.ports)}")
        if self.port is not None and self.port not in shape.ports:
            raise ValueError(f"{self.kind} does not befall the port {self.port}")
        return self

    @property
    def befalls(self) -> Port | None:
        """The port that the fault befalls, also where only one was possible and none was told."""
        return self.port or next(iter(_SHAPES[self.kind].ports), None)

    @property
    def lasts_s(self) -> float:
        """How long it lasts; infinite for the rest of the dive."""
        return _SHAPES[self.kind].for_s if self.for_s is None else self.for_s


def read_faults(path: Path) -> tuple[Fault, ...]:
    """Read a script: JSON lines where its first character is ``{``, else TOML.

    Raises InputError where it cannot be read, DataError with the first mistake where it is wrong.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        raise InputError(f"cannot read {path}: {error.strerror}; name a script of faults that exists") from None
    except UnicodeDecodeError:
        raise DataError(f"{path} is not UTF-8 text; see `lacuna emulate --help` for scripts of faults") from None
    raw = _json_lines(path, text) if text.lstrip().startswith("{") else _toml(path, text)
    return tuple(_fault(path, number, each) for number, each in enumerate(raw, 1))


def _json_lines(path: Path, text: str) -> list[Any]:
    try:
        return [json.loads(line) for line in text.splitlines() if line.strip()]
    except json.JSONDecodeError as error:
        raise DataError(f"{path}: broken JSON ({error}); write one fault a line") from None


def _toml(path: Path, text: str) -> list[Any]:
    try:
        raw = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise DataError(f"{path}: broken TOML ({error}); write key = value lines under [[fault]]") from None
    faults = raw.pop("fault", [])
    if raw or not isinstance(faults, list):
        raise DataError(f"{path}: only [[fault]] tables are known; see `lacuna emulate --help`")
    return faults


def _fault(path: Path, number: int, raw: object) -> Fault:
    try:
        return Fault.model_validate(raw)
    except ValidationError as error:
        first = error.errors()[0]
        key = ".".join(str(part) for part in first["loc"])
        said = first["msg"].removeprefix("Value error, ")
        where = f"fault {number}" + (f", {key}" if key else "")
        raise DataError(f"{path}: {where}: {said}; see `lacuna emulate --help`") from None
