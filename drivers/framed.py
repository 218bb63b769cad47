"""Reader of a line of frames: cuts them out, has each interpreted, counts what came."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from typing import Protocol

from config.errors import FrameError
from drivers.counters import Counters
from drivers.statements import AnyStatement, Message
from drivers.wire import Cut, Cutter, Judge

Said = tuple[str, Sequence[AnyStatement]]
"""Name of a frame and what it says."""


class Interpreter(Protocol):
    """Knows what the frames of one protocol mean."""

    def read(self, frame: bytes) -> Said:
        """Return the name of a whole frame and what it says; raise FrameError, with a word for the counters."""


class FrameReader:
    """A `drivers.statements.Reader` of frames that ``judge`` finds and ``interpreter`` reads."""

    def __init__(self, start: re.Pattern[bytes], judge: Judge, interpreter: Interpreter, byte_ns: int) -> None:
        self.interpreter = interpreter
        self._cutter = Cutter(start, judge, byte_ns)
        self._frames: Counter[str] = Counter()
        self._bad: Counter[str] = Counter()

    @property
    def pending(self) -> int:
        """Bytes held that may become a frame."""
        return self._cutter.pending

    @property
    def counters(self) -> Counters:
        """What was seen so far, by the interpreter's names."""
        return Counters(dict(self._frames), self._cutter.skipped, dict(self._cutter.bad + self._bad))

    def push(self, t_ns: int, data: bytes) -> list[Message]:
        """Take bytes that arrived at ``t_ns`` and return the messages that they complete."""
        return [message for cut in self._cutter.push(t_ns, data) for message in self._read(cut)]

    def finish(self) -> list[Message]:
        """End the stream."""
        return [message for cut in self._cutter.finish() for message in self._read(cut)]

    def _read(self, cut: Cut) -> list[Message]:
        try:
            name, statements = self.interpreter.read(cut.data)
        except FrameError as error:
            self._bad[str(error)] += 1
            return []
        self._frames[name] += 1
        return [Message(cut.t_ns, name, tuple(statements))] if statements else []
