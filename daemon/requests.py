"""Requests of the operator's programs: one JSON object with ``id`` and ``do`` in, one with the same ``id`` out."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass, field
from typing import Annotated, Any, Final

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from drivers.records import Json

LARGEST_BYTES: Final = 16 * 1024
"""A longer request is refused; the socket drops one of more than a few of these unread."""


class Fields(BaseModel):
    """What a request may carry: nothing else, and nothing of another type."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, strict=True)


class Nothing(Fields):
    """A request that carries nothing."""


class SnapshotFields(Fields):
    """Topics whose newest messages are wanted; none: all."""

    topics: list[str] = Field([], max_length=16)


class SonarFields(Fields):
    """Settings of the sonar head; what is left out stays.  ``sector_deg`` null is a full circle."""

    range_m: float | None = Field(None, ge=0.3, le=300)
    gain_pct: float | None = Field(None, ge=0, le=100)
    step_deg: float | None = Field(None, ge=0.225, le=7.2)
    sector_deg: Annotated[list[Annotated[float, Field(ge=-360, le=360)]], Field(min_length=2, max_length=2)] | None = (
        None
    )
    start: bool = False
    stop: bool = False

    @model_validator(mode="after")
    def _one_way(self) -> SonarFields:
        if self.start and self.stop:
            raise ValueError("start or stop, not both")
        if not self.model_fields_set:
            raise ValueError("name at least one of range_m, gain_pct, step_deg, sector_deg, start, stop")
        return self


class TextFields(Fields):
    """Words of the operator."""

    text: str = Field("", max_length=500)


class HintFields(Fields):
    """The pilot moved about so far in such a direction since the last station.

    Either ``distance_m`` and ``direction_deg`` (clockwise from north), or ``dx_m`` (east) and ``dy_m`` (north).
    """

    distance_m: float | None = Field(None, ge=0, le=100)
    direction_deg: float | None = Field(None, ge=-360, le=360)
    dx_m: float | None = Field(None, ge=-100, le=100)
    dy_m: float | None = Field(None, ge=-100, le=100)
    sd_m: float | None = Field(None, gt=0, le=100)

    @model_validator(mode="after")
    def _one_form(self) -> HintFields:
        polar = self.distance_m is not None and self.direction_deg is not None
        if polar == (self.dx_m is not None and self.dy_m is not None):
            raise ValueError("give distance_m and direction_deg, or dx_m and dy_m")
        return self

    def event_fields(self) -> dict[str, Json]:
        """Return the hint as the log holds it; a third of the way is ``sd_m`` where none is given."""
        dx_m, dy_m = self.dx_m, self.dy_m
        if dx_m is None or dy_m is None:
            angle, far = math.radians(self.direction_deg or 0.0), self.distance_m or 0.0
            dx_m, dy_m = far * math.sin(angle), far * math.cos(angle)
        sd_m = self.sd_m if self.sd_m is not None else max(0.3, math.hypot(dx_m, dy_m) / 3)
        return {"dx_m": round(dx_m, 6), "dy_m": round(dy_m, 6), "sd_m": round(sd_m, 6)}


class TareFields(Fields):
    """The vehicle is at the surface: its pressure there, as told or as its sensor tells now.  ``port``: the feed."""

    port: str | None = Field(None, max_length=32)
    surface_mbar: float | None = Field(None, ge=500, le=1200)


class DropFields(Fields):
    """A station to be left out of the map, by the index of its scan."""

    station: int = Field(ge=0)


FORMS: Final[dict[str, type[Fields]]] = {
    "status": Nothing,
    "snapshot": SnapshotFields,
    "sonar": SonarFields,
    "mark": TextFields,
    "hint": HintFields,
    "drop": DropFields,
    "note": TextFields,
    "tare": TareFields,
    "save": Nothing,
}
"""What may be asked, and what each carries."""


@dataclass(frozen=True, slots=True)
class Request:
    """A request that is right: ``fields`` holds what was given, and no more."""

    id: Json
    do: str
    fields: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Refusal:
    """Why a request is not done: a code for programs, a message and a hint for people."""

    id: Json
    code: str
    message: str
    hint: str


def parse(data: bytes) -> Request | Refusal:
    """Return the request in ``data``, or why it is none; never raises."""
    if len(data) > LARGEST_BYTES:
        return Refusal(None, "too_large", f"a request of {len(data)} bytes", f"send at most {LARGEST_BYTES}")
    try:
        body = json.loads(data)
    except (ValueError, RecursionError):
        return Refusal(None, "malformed", "the request is not JSON", 'send {"id": 1, "do": "status"}')
    if not isinstance(body, dict):
        return Refusal(None, "malformed", "the request is not a JSON object", 'send {"id": 1, "do": "status"}')
    number = body.pop("id", None)
    if not isinstance(number, str | int | None):
        return Refusal(None, "malformed", "the id is neither text nor a whole number", "send text or a number")
    return _checked(number, body.pop("do", None), body)


def ok(number: Json, fields: dict[str, Json] | None = None) -> bytes:
    """Return the answer to a request that was done."""
    return _dump({"id": number, "ok": True, **(fields or {})})


def refused(refusal: Refusal) -> bytes:
    """Return the answer to a request that was not done."""
    error: Json = {"code": refusal.code, "message": refusal.message, "hint": refusal.hint}
    return _dump({"id": refusal.id, "ok": False, "error": error})


def _checked(number: str | int | None, do: object, fields: dict[str, Any]) -> Request | Refusal:
    if not isinstance(do, str) or do not in FORMS:
        return Refusal(number, "unknown", f"there is no request {str(do)[:40]!r}", "one of " + ", ".join(FORMS))
    try:
        form = FORMS[do].model_validate(fields)
    except ValidationError as error:
        said = "; ".join(_mistake(each["loc"], each["msg"]) for each in error.errors(include_url=False)[:5])
        return Refusal(number, "invalid", said, f"{do} takes " + (", ".join(FORMS[do].model_fields) or "nothing"))
    given = form.event_fields() if isinstance(form, HintFields) else form.model_dump(exclude_unset=True)
    return Request(number, do, given)


def _mistake(loc: tuple[int | str, ...], message: str) -> str:
    key = ".".join(str(step)[:40] for step in loc)
    return f"{key}: {message}" if key else message.removeprefix("Value error, ")


def _dump(body: dict[str, Json]) -> bytes:
    return json.dumps(body, allow_nan=False).encode()
