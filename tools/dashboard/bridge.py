"""From ZeroMQ to browsers: one subscriber, a memory, and an outbox for each browser.

The subscriber never waits for a browser: it reads whatever comes, and each outbox keeps the newest of each kind.  A
slow browser so hears less often, but never old news, and slows nobody.
"""

from __future__ import annotations

import asyncio
import json
import time
from dataclasses import dataclass
from typing import Final

import zmq
import zmq.asyncio

from config.errors import DataError, FrameError
from daemon import wire
from daemon.snapshots import Snapshot
from drivers.records import Json
from tools.dashboard.memory import Memory
from tools.dashboard.outbox import Outbox
from tools.dashboard.peer import Peer

HEARTBEAT_S: Final = 1.0
RESUBSCRIBE_S: Final = 5.0


@dataclass(slots=True)
class Browser:
    """One open page."""

    outbox: Outbox
    news: asyncio.Event


class Bridge:
    """Listens to the daemon at ``peer`` and hands on what is new to every open page."""

    def __init__(self, peer: Peer) -> None:
        self._peer = peer
        self._memory = Memory()
        self._browsers: list[Browser] = []
        self._heard_s: float | None = None
        self._asked_s = 0.0
        self._refused: str | None = None
        self._damaged = 0

    def __len__(self) -> int:
        return len(self._browsers)

    def join(self) -> Browser:
        """Return a new browser whose outbox holds all that is known."""
        browser = Browser(Outbox(self._memory), asyncio.Event())
        for message in (self._heartbeat(), *self._memory.everything()):
            browser.outbox.offer(message)
        browser.news.set()
        self._browsers.append(browser)
        return browser

    def leave(self, browser: Browser) -> None:
        """Forget a browser."""
        self._browsers.remove(browser)

    async def run(self) -> None:
        """Listen and tell, until cancelled."""
        with self._peer.context() as context, self._peer.subscriber(context) as socket:
            beating = asyncio.create_task(self._beat())
            try:
                while True:
                    frames = await socket.recv_multipart()
                    self._receive(frames, socket)
            finally:
                beating.cancel()

    def _receive(self, frames: list[bytes], socket: zmq.asyncio.Socket) -> None:
        try:
            message = wire.decode(frames)
            # A browser's JSON knows neither NaN nor infinity: such a message would end its connection.
            json.dumps(message.snapshot.fields, allow_nan=False)
        except DataError as error:
            self._refused = str(error)
            return
        except (FrameError, ValueError):
            self._damaged += 1
            return
        self._heard_s, self._refused = time.monotonic(), None
        if message.session != self._memory.session:
            for browser in self._browsers:
                browser.outbox.clear()
        if self._memory.push(message):
            self._tell(message)
        elif self._memory.waiting_for_grid:
            self._ask_for_grid(socket)

    def _ask_for_grid(self, socket: zmq.asyncio.Socket) -> None:
        """Subscribe anew: whoever joins is given the whole grid at once."""
        if time.monotonic() - self._asked_s < RESUBSCRIBE_S:
            return
        self._asked_s = time.monotonic()
        socket.unsubscribe("grid/key")
        socket.subscribe("grid/key")

    async def _beat(self) -> None:
        while True:
            await asyncio.sleep(HEARTBEAT_S)
            self._tell(self._heartbeat())

    def _tell(self, message: wire.Message) -> None:
        for browser in self._browsers:
            browser.outbox.offer(message)
            browser.news.set()

    def _heartbeat(self) -> wire.Message:
        silent = None if self._heard_s is None else round(time.monotonic() - self._heard_s, 2)
        fields: dict[str, Json] = {
            "source": self._peer.snapshots,
            "silent_s": silent,
            "grid": "waiting" if self._memory.waiting_for_grid else "ok",
            "refused": self._refused,
            "damaged": self._damaged,
        }
        return wire.Message(0, self._memory.session or "", Snapshot("bridge", 0, 0, fields))
