from __future__ import annotations

import json
import socket
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import numpy as np
import pytest
import zmq
import zmq.auth

from config.errors import ConfigError, PortError
from config.schema import Publish
from daemon import requests
from daemon.broker import Broker, Route
from daemon.cache import LastValues
from daemon.requests import Request
from daemon.snapshots import Snapshot
from daemon.wire import Message, decode, encode

Socket = zmq.Socket[bytes]


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def frames(topic: str, value: int = 0, size: int = 4) -> list[bytes]:
    array = (
        np.full(size, value, np.uint8) if size <= 4 else np.random.default_rng(value).integers(0, 255, size, np.uint8)
    )
    return encode(Snapshot(topic, value, value, {"value": value}, {"cells": array}), 0, "")


class Net:
    """The clients' side: sockets that are closed when the test is done."""

    def __init__(self) -> None:
        self.context: zmq.Context[Socket] = zmq.Context()
        self.sockets: list[Socket] = []

    def socket(self, kind: int) -> Socket:
        made = self.context.socket(kind)
        self.sockets.append(made)
        return made

    def close(self) -> None:
        for each in self.sockets:
            each.close(linger=0)
        self.context.term()


@pytest.fixture
def net() -> Iterator[Net]:
    made = Net()
    yield made
    made.close()


@pytest.fixture
def publish() -> Publish:
    return Publish(port=free_port(), request_port=free_port())


@pytest.fixture
def broker(publish: Publish) -> Iterator[Broker]:
    def ask(route: Route, request: Request) -> None:
        made.answer(route, requests.ok(request.id, {"did": request.do}))

    with Broker(publish, "s1", ask) as made:
        yield made


def subscribe(net: Net, publish: Publish, *topics: str) -> Socket:
    reader: Socket = net.socket(zmq.SUB)
    for topic in topics:
        reader.subscribe(topic)
    reader.connect(f"{publish.bind}:{publish.port}")
    return reader


def until(broker: Broker, done: Callable[[], bool], wait_s: float = 10.0) -> bool:
    end = time.monotonic() + wait_s
    while not done():
        if time.monotonic() > end:
            return False
        broker.turn(0.01)
    return True


def read(reader: Socket, into: list[Message] | None = None) -> list[Message]:
    messages = [] if into is None else into
    while reader.poll(0):
        messages.append(decode(reader.recv_multipart()))
    return messages


def test_messages_are_numbered_by_topic_and_deltas_name_their_base() -> None:
    values = LastValues("s")
    assert values.take(frames("grid/delta")) is None
    taken = [values.take(frames(topic)) for topic in ("grid/key", "ping", "grid/delta", "grid/delta", "ping")]
    messages = [decode(each) for each in taken if each is not None]
    assert [(m.snapshot.topic, m.seq) for m in messages] == [
        ("grid/key", 0), ("ping", 0), ("grid/delta", 0), ("grid/delta", 1), ("ping", 1),
    ]  # fmt: skip
    assert messages[2].snapshot.fields["base"] == {"topic": "grid/key", "seq": 0}
    assert messages[3].snapshot.fields["base"] == {"topic": "grid/delta", "seq": 0}


@pytest.mark.parametrize("prefix", [b"", b"grid/", b"grid/key", b"grid/delta"])
def test_the_cache_gives_the_key_and_all_deltas_since(prefix: bytes) -> None:
    values = LastValues("s")
    for topic in ("grid/key", "grid/delta", "grid/key", "grid/delta", "ping", "grid/delta"):
        values.take(frames(topic))
    kept = [(m.snapshot.topic, m.seq) for m in map(decode, values.newest([prefix]))]
    assert kept == [("grid/key", 1), ("grid/delta", 1), ("grid/delta", 2)]


def test_a_late_joiner_has_the_state_at_once(broker: Broker, net: Net, publish: Publish) -> None:
    for topic in ("station", "grid/key", "grid/delta", "mesh", "ping"):
        broker.publish(frames(topic))
    reader = subscribe(net, publish, "")
    got: list[Message] = []
    assert until(broker, lambda: len(read(reader, got)) >= 4)
    assert [m.snapshot.topic for m in got[:4]] == ["station", "grid/key", "mesh", "grid/delta"]
    assert {m.session for m in got} == {"s1"}


def test_a_reader_that_stood_still_gets_the_newest(broker: Broker, net: Net, publish: Publish) -> None:
    reader = net.socket(zmq.SUB)
    reader.setsockopt(zmq.RCVHWM, 2)
    reader.subscribe("")
    reader.connect(f"{publish.bind}:{publish.port}")
    broker.publish(frames("mesh", 0))
    assert until(broker, lambda: bool(read(reader)))
    for value in range(1, 300):
        broker.publish(frames("mesh", value, 200_000))
        broker.turn(0)
    for topic in ("grid/key", "grid/delta", "station"):
        broker.publish(frames(topic, 7))
    got: dict[str, object] = {}

    def newest() -> bool:
        got.update({message.snapshot.topic: message.snapshot.fields["value"] for message in read(reader)})
        return got == {"mesh": 299, "grid/key": 7, "grid/delta": 7, "station": 7}

    assert until(broker, newest, wait_s=30.0)


def test_a_reader_that_stands_still_holds_nobody_up(broker: Broker, net: Net, publish: Publish) -> None:
    slow = net.socket(zmq.SUB)
    slow.setsockopt(zmq.RCVHWM, 2)
    quick = subscribe(net, publish, "")
    slow.subscribe("")
    slow.connect(f"{publish.bind}:{publish.port}")
    broker.publish(frames("mesh", 0))
    got: list[Message] = []
    assert until(broker, lambda: bool(read(quick, got) and slow.poll(0)))
    for value in range(1, 150):
        broker.publish(frames("mesh", value, 200_000))
        assert until(broker, partial(has_come, quick, value))
    late = subscribe(net, publish, "mesh")
    assert until(broker, lambda: bool(late.poll(0)))
    assert read(late)[-1].snapshot.fields["value"] == 149


def has_come(reader: Socket, value: int) -> bool:
    return value in {message.snapshot.fields["value"] for message in read(reader)}


def ask(net: Net, publish: Publish, broker: Broker, kind: int, words: bytes) -> dict[str, object]:
    client = net.socket(kind)
    client.connect(f"{publish.bind}:{publish.request_port}")
    client.send(words)
    assert until(broker, lambda: bool(client.poll(0)))
    answer: dict[str, object] = json.loads(client.recv())
    return answer


@pytest.mark.parametrize("kind", [zmq.REQ, zmq.DEALER])
def test_a_request_is_answered(broker: Broker, net: Net, publish: Publish, kind: int) -> None:
    assert ask(net, publish, broker, kind, b'{"id":4,"do":"status"}') == {"id": 4, "ok": True, "did": "status"}


def test_broken_and_oversized_requests_do_no_harm(broker: Broker, net: Net, publish: Publish) -> None:
    refusal = ask(net, publish, broker, zmq.DEALER, b"\xff\x00 nonsense")
    assert refusal["error"] == {
        "code": "malformed", "message": "the request is not JSON", "hint": 'send {"id": 1, "do": "status"}',
    }  # fmt: skip
    rude = net.socket(zmq.DEALER)
    rude.connect(f"{publish.bind}:{publish.request_port}")
    rude.send(b"x" * (1 << 20))
    for _ in range(20):
        rude.send_multipart([b""] * 50)
        broker.turn(0.005)
    assert ask(net, publish, broker, zmq.REQ, b'{"id":5,"do":"save"}')["ok"] is True


def test_a_busy_address_is_told_in_one_line(broker: Broker, publish: Publish) -> None:
    with pytest.raises(PortError, match=f":{publish.port} is in use") as caught:
        Broker(publish, "s2", lambda _route, _request: None)
    assert "\n" not in str(caught.value)
    assert broker.values.session == "s1"


def test_a_busy_request_address_frees_the_other(broker: Broker, publish: Publish) -> None:
    other = Publish(port=free_port(), request_port=publish.request_port)
    with pytest.raises(PortError, match=f":{publish.request_port} is in use"):
        Broker(other, "s2", lambda _route, _request: None)
    with Broker(Publish(port=other.port, request_port=free_port()), "s3", lambda _route, _request: None):
        assert broker.values.session == "s1"


def test_an_address_of_another_machine_is_refused() -> None:
    with pytest.raises(ConfigError, match="lacuna keygen"):
        Broker(Publish(bind="tcp://192.0.2.1"), "s", lambda _route, _request: None)


@pytest.fixture
def keys(tmp_path: Path) -> Path:
    zmq.auth.create_certificates(tmp_path, "server")
    zmq.auth.create_certificates(tmp_path, "stranger")
    (tmp_path / "authorized").mkdir()
    zmq.auth.create_certificates(tmp_path / "authorized", "client")
    return tmp_path


def curve_reader(net: Net, publish: Publish, keys: Path, who: Path | None) -> Socket:
    reader = net.socket(zmq.SUB)
    if who is not None:
        reader.curve_publickey, reader.curve_secretkey = zmq.auth.load_certificate(who)
        reader.curve_serverkey, _ = zmq.auth.load_certificate(keys / "server.key")
    reader.subscribe("")
    reader.connect(f"{publish.bind}:{publish.port}")
    return reader


def test_only_who_is_on_the_list_reads(net: Net, keys: Path) -> None:
    publish = Publish(port=free_port(), request_port=free_port(), keys=str(keys))
    with Broker(publish, "s", lambda _route, _request: None) as broker:
        broker.publish(frames("mesh", 7))
        friend = curve_reader(net, publish, keys, keys / "authorized" / "client.key_secret")
        stranger = curve_reader(net, publish, keys, keys / "stranger.key_secret")
        plain = curve_reader(net, publish, keys, None)
        assert until(broker, lambda: bool(friend.poll(0)))
        until(broker, lambda: False, wait_s=0.3)
        broker.publish(frames("mesh", 8))
        until(broker, lambda: False, wait_s=0.3)
        assert [m.snapshot.fields["value"] for m in read(friend)][-1] == 8
        assert read(stranger) == []
        assert read(plain) == []


def test_any_address_is_allowed_with_keys(keys: Path) -> None:
    publish = Publish(bind="tcp://0.0.0.0", port=free_port(), request_port=free_port(), keys=str(keys))
    with Broker(publish, "s", lambda _route, _request: None) as broker:
        assert broker.values.session == "s"
