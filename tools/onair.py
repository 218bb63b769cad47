"""A replay on the air: the topics of a live dive, from a recorded one, on the same sockets."""

from __future__ import annotations

import math
import time
from typing import Final, Self

from config.schema import Config, Publish
from daemon import requests, snapshots
from daemon.beams import Beams
from daemon.broker import Broker, Route
from daemon.desk import send_snapshot
from daemon.requests import Refusal, Request
from daemon.snapshots import Snapshot
from daemon.wire import encode
from drivers.records import Chunk, Event, Json, Record
from tools.pace import Pace

_HEALTH_S: Final = 1.0
_SLICE_S: Final = 0.05


class OnAir:
    """Publishes what a replay gives, at ``speed`` times the log's pace; raises as ``Broker`` does."""

    def __init__(self, config: Config, publish: Publish, name: str, speed: float) -> None:
        self._session = f"replay-{name}-{time.time_ns()}"
        self._beams = Beams(config)
        self._pace = Pace(speed) if math.isfinite(speed) else None
        self._site = config.site.name
        self._stations = 0
        self._told_s = 0.0
        self._broker = Broker(publish, self._session, self._answer)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._broker.close()

    def take(self, record: Record, told: list[Snapshot]) -> None:
        """Wait until it is time for ``record``, then publish it and what became new by it."""
        while self._pace is not None and (left_s := self._pace.left_s(record)) > 0:
            self._broker.turn(min(left_s, _SLICE_S))
        for each in [*self._own(record), *told]:
            self._stations += each.topic == "station"
            self._broker.publish(encode(each, 0, ""))
        if time.monotonic() - self._told_s >= _HEALTH_S:
            self._told_s = time.monotonic()
            fields: dict[str, Json] = {
                "site": self._site,
                "replay": True,
                "map": {"scans": self._stations, "lag_s": 0.0},
            }
            self._broker.publish(encode(snapshots.health(record.t_ns, record.utc_ns, fields), 0, ""))
        self._broker.turn(0)

    def _tell_health(self, record: Record) -> None:
        fields: dict[str, Json] = {"site": self._site, "replay": True, "map": {"scans": self._stations, "lag_s": 0.0}}
        self._broker.publish(encode(snapshots.health(record.t_ns, record.utc_ns, fields), 0, ""))

    def _own(self, record: Record) -> list[Snapshot]:
        match record:
            case Chunk():
                return self._beams.push(record)
            case Event():
                return [snapshots.event(record)]
            case _:
                return []

    def _answer(self, route: Route, request: Request) -> None:
        if request.do == "snapshot":
            send_snapshot(self._broker, route, request)
        elif request.do == "status":
            self._broker.answer(route, requests.ok(request.id, {"session": self._session, "replay": True}))
        else:
            refusal = Refusal(request.id, "replay", f"a replay cannot {request.do}", "ask a running daemon")
            self._broker.answer(route, requests.refused(refusal))
