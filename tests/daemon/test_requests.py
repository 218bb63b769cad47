from __future__ import annotations

import json
import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from daemon.requests import LARGEST_BYTES, Refusal, Request, ok, parse, refused


def ask(**body: object) -> Request | Refusal:
    return parse(json.dumps(body).encode())


def test_what_is_right_is_a_request() -> None:
    assert ask(id=1, do="status") == Request(1, "status", {})
    assert ask(id="a", do="mark", text="stairs") == Request("a", "mark", {"text": "stairs"})
    assert ask(id=2, do="sonar", range_m=5, gain_pct=40.5) == Request(2, "sonar", {"range_m": 5.0, "gain_pct": 40.5})
    assert ask(id=2, do="sonar", sector_deg=None) == Request(2, "sonar", {"sector_deg": None})
    assert ask(do="drop", station=0) == Request(None, "drop", {"station": 0})


def test_both_forms_of_a_hint_are_one() -> None:
    polar = ask(id=1, do="hint", distance_m=2.0, direction_deg=90)
    assert polar == ask(id=1, do="hint", dx_m=2.0, dy_m=0.0)
    assert isinstance(polar, Request)
    assert polar.fields == {"dx_m": 2.0, "dy_m": 0.0, "sd_m": pytest.approx(2 / 3, abs=1e-6)}


@pytest.mark.parametrize(
    ("body", "code", "says"),
    [
        ({"id": 1}, "unknown", "one of status"),
        ({"id": 1, "do": "thruster"}, "unknown", "one of status"),
        ({"id": 1, "do": ["x"]}, "unknown", "one of status"),
        ({"id": [1], "do": "status"}, "malformed", "text or a number"),
        ({"id": 1, "do": "status", "extra": 1}, "invalid", "status takes nothing"),
        ({"id": 1, "do": "sonar"}, "invalid", "range_m"),
        ({"id": 1, "do": "sonar", "range_m": 1e9}, "invalid", "range_m"),
        ({"id": 1, "do": "sonar", "range_m": math.nan}, "invalid", "range_m"),
        ({"id": 1, "do": "sonar", "range_m": "5"}, "invalid", "range_m"),
        ({"id": 1, "do": "sonar", "sector_deg": [1, 2, 3]}, "invalid", "sector_deg"),
        ({"id": 1, "do": "sonar", "start": True, "stop": True}, "invalid", "start"),
        ({"id": 1, "do": "hint", "dx_m": 1}, "invalid", "dx_m"),
        ({"id": 1, "do": "drop", "station": -1}, "invalid", "station"),
        ({"id": 1, "do": "drop", "station": True}, "invalid", "station"),
        ({"id": 1, "do": "note", "text": "x" * 501}, "invalid", "text"),
    ],
)
def test_what_is_wrong_is_refused_with_a_hint(body: dict[str, object], code: str, says: str) -> None:
    refusal = ask(**body)
    assert isinstance(refusal, Refusal)
    assert refusal.code == code
    assert says in refusal.hint
    assert refusal.message
    assert refusal.id == (body["id"] if code != "malformed" else None)


@pytest.mark.parametrize("data", [b"", b"[]", b"null", b"{", b"\xff", b"[" * 10_000, b"1" * 5000])
def test_what_is_no_object_is_malformed(data: bytes) -> None:
    refusal = parse(data)
    assert isinstance(refusal, Refusal)
    assert refusal.code == "malformed"


def test_too_much_is_refused_unread() -> None:
    refusal = parse(b" " * (LARGEST_BYTES + 1))
    assert isinstance(refusal, Refusal)
    assert refusal.code == "too_large"


@settings(max_examples=300, deadline=None)
@given(
    st.binary(max_size=200)
    | st.recursive(st.none() | st.integers() | st.text(), st.lists).map(json.dumps).map(str.encode)
)
def test_noise_never_raises(data: bytes) -> None:
    assert isinstance(parse(data), Request | Refusal)


def test_answers_carry_the_id() -> None:
    assert json.loads(ok(7, {"stations": 3})) == {"id": 7, "ok": True, "stations": 3}
    answer = json.loads(refused(Refusal("a", "busy", "the line is lost", "wait")))
    assert answer == {"id": "a", "ok": False, "error": {"code": "busy", "message": "the line is lost", "hint": "wait"}}
