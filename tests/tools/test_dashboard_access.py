"""Nobody but this machine, or whoever has the token, sees the page or asks the daemon."""

from __future__ import annotations

import pytest
from starlette.datastructures import Headers

from tools.dashboard.access import COOKIE, Access

HERE = {"host": "127.0.0.1:8080"}
OWN = {**HERE, "origin": "http://127.0.0.1:8080"}


@pytest.mark.parametrize("host", ["127.0.0.1:8080", "localhost:8080", "[::1]:8080", "127.0.0.1"])
def test_this_machine_may_look(host: str) -> None:
    assert Access().refusal(Headers({"host": host}), "GET", "http") is None


@pytest.mark.parametrize(
    "host", ["evil.example:8080", "192.168.1.4:8080", "", "127.0.0.1.evil.example", "0.0.0.0:8080"]
)
def test_a_name_that_was_made_to_point_here_is_refused(host: str) -> None:
    refusal = Access().refusal(Headers({"host": host}), "GET", "http")
    assert refusal is not None
    assert refusal[0] == 421


@pytest.mark.parametrize("kind", ["http", "websocket"])
@pytest.mark.parametrize(
    "origin", [None, "null", "http://evil.example", "http://127.0.0.1:9999", "http://127.0.0.1.evil:8080"]
)
def test_other_pages_may_not_ask_or_listen(kind: str, origin: str | None) -> None:
    headers = HERE if origin is None else {**HERE, "origin": origin}
    refusal = Access().refusal(Headers(headers), "POST" if kind == "http" else "", kind)
    assert refusal is not None
    assert refusal[0] == 403


def test_the_own_page_may_ask_and_listen() -> None:
    assert Access().refusal(Headers(OWN), "POST", "http") is None
    assert Access().refusal(Headers(OWN), "", "websocket") is None


def test_with_a_token_only_its_cookie_lets_in() -> None:
    access = Access("correct horse")
    assert access.refusal(Headers(OWN), "GET", "http") is not None
    assert access.refusal(Headers({**OWN, "cookie": f"{COOKIE}=wrong"}), "GET", "http") is not None
    assert access.refusal(Headers({**OWN, "cookie": f'{COOKIE}="correct horse"'}), "GET", "http") is None
    elsewhere = {"host": "boat.local:8080", "origin": "http://boat.local:8080", "cookie": f'{COOKIE}="correct horse"'}
    assert access.refusal(Headers(elsewhere), "", "websocket") is None
    assert access.refusal(Headers({**elsewhere, "origin": "http://evil.example"}), "", "websocket") is not None


def test_without_a_token_nothing_fits() -> None:
    assert not Access().fits("")
    assert Access("correct horse").fits("correct horse")
    assert not Access("correct horse").fits("correct hors\u00e9")
