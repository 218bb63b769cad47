"""The dashboard's server as it is started: what it answers, what it refuses, and to whom."""

from __future__ import annotations

import http.client
import json
import re
import socket
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import numpy as np
import pytest
from websockets.exceptions import InvalidStatus
from websockets.sync.client import ClientConnection, connect
from websockets.typing import Origin

import tools.dashboard.server
from daemon.snapshots import Snapshot
from tests.tools.fake_daemon import FakeDaemon
from tests.tools.live_page import Dashboard, dashboard, free_port, lacuna


def fetch(
    url: str, method: str, path: str, body: bytes = b"", **headers: str
) -> tuple[http.client.HTTPResponse, bytes]:
    connection = http.client.HTTPConnection(urlsplit(url).netloc, timeout=20)
    try:
        connection.request(
            method, path, body or None, {name.replace("_", "-"): value for name, value in headers.items()}
        )
        answer = connection.getresponse()
        return answer, answer.read()
    finally:
        connection.close()


def ask(url: str, request: object, **headers: str) -> tuple[int, Any]:
    own = {"origin": url.rstrip("/"), "content_type": "application/json", **headers}
    answer, body = fetch(url, "POST", "/api/request", json.dumps(request).encode(), **own)
    return answer.status, json.loads(body) if answer.getheader("content-type") == "application/json" else body


def first_frames(url: str, wanted: set[str]) -> dict[str, dict[str, Any]]:
    """Headers of the first message of each topic that a page gets."""
    got: dict[str, dict[str, Any]] = {}
    with connect(url.replace("http", "ws") + "ws", origin=Origin(url.rstrip("/")), max_size=None) as socket:
        while not wanted <= got.keys():
            frame = socket.recv(timeout=20)
            assert isinstance(frame, bytes)
            header = json.loads(frame[4 : 4 + int.from_bytes(frame[:4], "little")])
            got.setdefault(header["topic"], header)
    return got


def test_the_page_and_all_it_needs_come_from_here(served: Dashboard) -> None:
    answer, body = fetch(served.url, "GET", "/")
    assert answer.status == 200
    assert "default-src 'self'" in str(answer.getheader("content-security-policy"))
    for path in re.findall(r'(?:src|href)="([^"]+)"', body.decode()):
        assert fetch(served.url, "GET", f"/{path}")[0].status == 200, path
    answer, body = fetch(served.url, "GET", "/plotly.min.js")
    assert answer.status == 200
    assert b"plotly.js v" in body[:200]
    assert fetch(served.url, "GET", "/static/../server.py")[0].status == 404


def test_no_address_of_another_machine_stands_in_the_page() -> None:
    for path in Path(tools.dashboard.server.STATIC).iterdir():
        text = path.read_text().replace("http://www.w3.org/2000/svg", "")
        assert not re.search(r"(https?:)?//[a-z]", re.sub(r"^\s*//.*$|[;{})] // .*$", "", text, flags=re.MULTILINE)), (
            path.name
        )


def test_a_new_page_gets_all_that_is_known(served: Dashboard) -> None:
    got = first_frames(served.url, {"bridge", "grid/key", "station", "fill", "mesh", "guide", "health", "ping"})
    assert [each["name"] for each in got["mesh"]["arrays"]] == ["vertices", "triangles", "kind", "certainty"]
    assert got["grid/key"]["arrays"][0]["shape"] == [2, 160, 220]
    assert got["grid/key"]["as_of"]["topic"] == "grid/key"
    assert got["bridge"]["silent_s"] is not None


def test_a_request_reaches_the_daemon_and_its_answer_the_page(served: Dashboard, daemon: FakeDaemon) -> None:
    assert ask(served.url, {"id": 7, "do": "hint", "dx_m": 1.5, "dy_m": -0.5}) == (200, {"id": 7, "ok": True})
    assert daemon.heard[-1].do == "hint"
    assert daemon.heard[-1].fields["dx_m"] == 1.5
    status, answer = ask(served.url, {"id": "x", "do": "sonar", "range_m": 200.0})
    assert (status, answer["error"]["message"]) == (200, "the head reaches 100 m.")


@pytest.mark.parametrize(
    ("request_", "code"),
    [
        ({"id": 1, "do": "shutdown"}, "unknown"),
        ([1], "malformed"),
        ({"id": 1, "do": "sonar", "gain_pct": 900}, "invalid"),
    ],
)
def test_a_wrong_request_is_answered_in_words(
    served: Dashboard, daemon: FakeDaemon, request_: object, code: str
) -> None:
    before = len(daemon.heard)
    status, answer = ask(served.url, request_)
    assert (status, answer["error"]["code"]) == (400, code)
    assert answer["error"]["hint"]
    assert len(daemon.heard) == before


def test_other_pages_and_forms_are_refused(served: Dashboard, daemon: FakeDaemon) -> None:
    before = len(daemon.heard)
    mark = {"id": 1, "do": "mark"}
    assert ask(served.url, mark, origin="http://evil.example")[0] == 403
    assert ask(served.url, mark, host="evil.example")[0] == 421
    assert ask(served.url, mark, content_type="text/plain")[0] == 415
    assert ask(served.url, {"id": 1, "do": "note", "text": "x" * 20_000})[0] == 400
    assert len(daemon.heard) == before
    with (
        pytest.raises(InvalidStatus),
        connect(served.url.replace("http", "ws") + "ws", origin=Origin("http://evil.example")),
    ):
        pass


def test_without_a_daemon_a_request_is_answered_all_the_same() -> None:
    with dashboard(free_port()) as served:
        status, answer = ask(served.url, {"id": 1, "do": "save"})
        assert (status, answer["error"]["code"]) == (200, "no-answer")
        assert "lacuna run" in answer["error"]["hint"]
        assert first_frames(served.url, {"bridge"})["bridge"]["silent_s"] is None


def test_a_page_that_does_not_read_slows_nobody_and_ends_on_the_newest() -> None:
    daemon = FakeDaemon(free_port())
    try:
        with dashboard(daemon.port) as served, listening(served.url) as slow, listening(served.url) as quick:
            noise = np.random.default_rng(1).random((200_000, 3), np.float32)
            for number in range(1, 31):
                daemon.say(Snapshot("mesh", number, number, {"number": number}, {"vertices": noise}))
            assert meshes(quick, 30)[-1] == 30
            late = meshes(slow, 30)
            assert late[-1] == 30
            assert len(late) < 20, "old meshes were kept for a page that did not read"
    finally:
        daemon.close()


def listening(url: str) -> ClientConnection:
    return connect(
        url.replace("http", "ws") + "ws", origin=Origin(url.rstrip("/")), max_size=None, max_queue=1, close_timeout=0.1
    )


def meshes(page: ClientConnection, last: int) -> list[int]:
    """Numbers of the meshes that come, up to ``last``."""
    got = [0]
    while got[-1] != last:
        frame = page.recv(timeout=30)
        assert isinstance(frame, bytes)
        header = json.loads(frame[4 : 4 + int.from_bytes(frame[:4], "little")])
        if header["topic"] == "mesh" and "number" in header:
            got.append(header["number"])
    return got


def test_keys_open_a_daemon_that_has_them_and_nothing_else_does(tmp_path: Path) -> None:
    keys = tmp_path / "keys"
    assert lacuna("keygen", str(keys)).returncode == 0
    daemon = FakeDaemon(free_port(), keys=str(keys))
    try:
        with dashboard(daemon.port, "--keys", str(keys)) as served:
            assert first_frames(served.url, {"bridge", "station", "ping"})["ping"]["session"] == "session-one"
            assert ask(served.url, {"id": 1, "do": "mark"}) == (200, {"id": 1, "ok": True})
        with dashboard(daemon.port) as served:
            assert ask(served.url, {"id": 1, "do": "mark"})[1]["error"]["code"] == "no-answer"
            assert first_frames(served.url, {"bridge"})["bridge"]["silent_s"] is None
    finally:
        daemon.close()


def test_a_token_lets_in_once_and_leaves_the_address() -> None:
    with dashboard(free_port(), "--token", "correct horse") as served:
        origin, _, query = served.url.partition("?")
        assert fetch(origin, "GET", "/")[0].status == 403
        answer, _ = fetch(origin, "GET", f"/?{query}")
        assert (answer.status, answer.getheader("location")) == (303, "/")
        cookie = str(answer.getheader("set-cookie"))
        assert "HttpOnly" in cookie
        assert "samesite=strict" in cookie.lower()
        assert fetch(origin, "GET", "/", cookie=cookie.split(";")[0])[0].status == 200


def test_a_busy_port_is_told_in_one_line() -> None:
    with socket.create_server(("127.0.0.1", 0)) as busy:
        ended = lacuna("dashboard", "--port", str(busy.getsockname()[1]))
    assert ended.returncode == 69
    assert ended.stderr.count("\n") == 1
    assert "--port" in ended.stderr


@pytest.mark.parametrize(
    ("words", "code", "said"),
    [
        (("--host", "0.0.0.0"), 78, "--token"),
        (("--host", "0.0.0.0", "--token", "short"), 64, "8 characters"),
        (("--connect", "5556"), 64, "tcp://"),
        (("--keys", "/nowhere"), 78, "keygen"),
        (("--port", "99999"), 64, "65535"),
    ],
)
def test_what_cannot_be_is_told_in_one_line(words: tuple[str, ...], code: int, said: str) -> None:
    ended = lacuna("dashboard", *words)
    assert (ended.returncode, ended.stdout) == (code, "")
    assert ended.stderr.count("\n") == 1
    assert said in ended.stderr


def test_missing_packages_are_told_in_one_line(tmp_path: Path) -> None:
    # A module of that name that fails as an absent one does stands before the installed one.
    (tmp_path / "starlette.py").write_text(
        "raise ModuleNotFoundError(\"No module named 'starlette'\", name='starlette')\n"
    )
    ended = lacuna("dashboard", "--port", "0", env={"PYTHONPATH": str(tmp_path)})
    assert ended.returncode == 78
    assert ended.stderr == "lacuna: the live page needs the package 'starlette'; pip install 'lacuna[laptop]'\n"
