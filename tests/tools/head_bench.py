"""An emulated head on the bench."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from config.schema import Sonar
from drivers.tritech.commands import Command, HeadCommand, HeadParameters, SendData, encode_command
from drivers.tritech.framing import Deframer
from drivers.tritech.headdata import HeadData
from drivers.tritech.messages import Message, decode
from drivers.tritech.settings import head_command
from tools.emulator.head import Head, HeadOptions, Sounding

MS = 1_000_000
PARAMETERS = head_command(Sonar()).parameters


def ramp(sounding: Sounding) -> NDArray[np.uint8]:
    return (np.arange(sounding.bins) % 256).astype(np.uint8)


class Bench:
    """A head on the bench with its own clock."""

    def __init__(self, options: HeadOptions | None = None) -> None:
        self.head = Head(ramp, options)
        self.t_ns = 0
        self._deframer = Deframer()

    def send(self, command: Command) -> None:
        self.head.push(self.t_ns, encode_command(command))

    def run(self, seconds: float, step_ns: int = 5 * MS) -> list[tuple[int, Message]]:
        """Let time pass; return what the head said, each with the time of its last byte."""
        heard = []
        end = self.t_ns + int(seconds * 1e9)
        while self.t_ns < end:
            self.t_ns += step_ns
            heard += [(self.t_ns, decode(frame)) for frame in self._deframer.push(self.t_ns, self.head.tick(self.t_ns))]
        assert self._deframer.skipped == 0
        return heard

    def ready(self, parameters: HeadParameters = PARAMETERS) -> Bench:
        self.run(5.0)
        self.send(HeadCommand(parameters))
        self.run(0.5)
        return self

    def pings(self, count: int) -> list[tuple[int, HeadData]]:
        """Ask, and ask again after each second reply, until ``count`` pings have come."""
        self.send(SendData())
        got: list[tuple[int, HeadData]] = []
        for _ in range(1000 * count):
            for t_ns, message in self.run(0.005):
                if isinstance(message, HeadData):
                    got.append((t_ns, message))
                    if len(got) % self.head.options.replies_per_request == 0:
                        self.send(SendData())
            if len(got) >= count:
                return got[:count]
        raise AssertionError(f"only {len(got)} pings came")
