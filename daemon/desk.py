"""Where requests are dealt with: answered at once, or handed to the acquisition and answered when it has done them."""

from __future__ import annotations

import json
import time
from dataclasses import dataclass
from typing import Any, Final

import zmq

from daemon import requests
from daemon.broker import Broker, Route
from daemon.link import DO
from daemon.requests import Refusal, Request
from daemon.status import Status
from daemon.wire import TOPICS, head
from drivers.records import Json

_PATIENCE_S: Final = 3.0
_MOST_OPEN: Final = 100


@dataclass(frozen=True, slots=True)
class _Open:
    route: Route
    request: Request
    until_s: float


def send_snapshot(broker: Broker, route: Route, request: Request) -> None:
    """Answer with the newest messages of the topics asked for, as they were published, behind the JSON."""
    wanted = request.fields.get("topics") or list(TOPICS)
    kept = broker.values.newest([topic.encode() for topic in wanted])
    parts: list[Json] = [{"topic": frames[0].decode(), "frames": len(frames)} for frames in kept]
    broker.answer(route, requests.ok(request.id, {"messages": parts}), [part for frames in kept for part in frames])


class Desk:
    """Deals with the requests that come to ``broker``; ``link`` leads to the acquisition."""

    def __init__(self, broker: Broker, link: zmq.Socket[bytes], status: Status) -> None:
        self._broker = broker
        self._link = link
        self._status = status
        self._open: dict[int, _Open] = {}
        self._token = 0

    def take(self, route: Route, request: Request) -> None:
        """Answer a request, or pass it on."""
        if request.do == "status":
            self._broker.answer(route, requests.ok(request.id, self._status.fields()))
        elif request.do == "snapshot":
            send_snapshot(self._broker, route, request)
        elif (refusal := self._objection(request)) is not None:
            self._broker.answer(route, requests.refused(refusal))
        else:
            self._pass_on(route, request)

    def hand_back(self, answer: dict[str, Any]) -> None:
        """Take the acquisition's answer to what was passed on."""
        waiting = self._open.pop(answer["token"], None)
        if waiting is None:
            return
        if answer["error"]:
            refusal = Refusal(waiting.request.id, "failed", answer["error"], "see health")
            self._broker.answer(waiting.route, requests.refused(refusal))
        else:
            fields: dict[str, Json] = answer["fields"]
            if waiting.request.do == "save":
                fields = {"map": self._status.map, **fields}
            self._broker.answer(waiting.route, requests.ok(waiting.request.id, fields))

    def note(self, text: str) -> None:
        """Have a word of the program's own written into the log, and published."""
        self._tell({"token": 0, "do": "note", "fields": {"text": text}})

    def tick(self) -> None:
        """Give up on what the acquisition has not answered in time."""
        now_s = time.monotonic()
        for token in [token for token, each in self._open.items() if now_s > each.until_s]:
            late = self._open.pop(token)
            refusal = Refusal(late.request.id, "unavailable", "the acquisition is silent", "see health, ask again")
            self._broker.answer(late.route, requests.refused(refusal))

    def _pass_on(self, route: Route, request: Request) -> None:
        if len(self._open) >= _MOST_OPEN:
            refusal = Refusal(request.id, "busy", "too many requests are open", "wait for their answers")
            self._broker.answer(route, requests.refused(refusal))
            return
        self._token += 1
        self._open[self._token] = _Open(route, request, time.monotonic() + _PATIENCE_S)
        self._tell({"token": self._token, "do": request.do, "fields": request.fields})

    def _tell(self, command: dict[str, Any]) -> None:
        self._link.send_multipart([b"acquire", DO, json.dumps(command).encode()])

    def _objection(self, request: Request) -> Refusal | None:
        if request.do == "drop" and request.fields["station"] not in self._stations():
            message = f"there is no station {request.fields['station']}"
            return Refusal(request.id, "invalid", message, "stations are numbered as in the topic 'station'")
        return None

    def _stations(self) -> set[int]:
        kept = self._broker.values.newest([b"station"])
        return {each["station"] for frames in kept for each in head(frames)[1]["stations"]}
