"""What a page is given: everything when it opens, then the newest of each kind, however slowly it reads."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from daemon.snapshots import Snapshot
from daemon.wire import Message
from drivers.records import Json
from tools.dashboard.memory import EVENTS_KEPT, Memory
from tools.dashboard.outbox import Outbox

SHAPE = (2, 6, 7)


def message(
    topic: str, seq: int, arrays: dict[str, NDArray[Any]] | None = None, session: str = "a", **fields: Json
) -> Message:
    return Message(seq, session, Snapshot(topic, seq, seq, fields, arrays or {}))


def key(seq: int, cells: NDArray[np.uint8]) -> Message:
    return message("grid/key", seq, {"cells": cells}, cell_m=0.05, x0_m=0.0, y0_m=0.0)


def delta(seq: int, base: tuple[str, int], place: tuple[int, int], cells: NDArray[np.uint8]) -> Message:
    based: Json = {"topic": base[0], "seq": base[1]}
    return message("grid/delta", seq, {"cells": cells}, base=based, row0=place[0], col0=place[1])


def read(frame: bytes) -> tuple[dict[str, Any], list[NDArray[Any]]]:
    """A frame as a browser reads it."""
    length = int.from_bytes(frame[:4], "little")
    header = json.loads(frame[4 : 4 + length])
    arrays, at = [], 4 + length
    for each in header["arrays"]:
        count = int(np.prod(each["shape"]))
        arrays.append(np.frombuffer(frame, each["dtype"], count, at).reshape(each["shape"]))
        at += arrays[-1].nbytes
    assert at == len(frame)
    return header, arrays


def drain(outbox: Outbox) -> list[dict[str, Any]]:
    return [read(frame)[0] for frame in iter(outbox.take, None)]


def test_a_late_page_gets_the_grid_put_together() -> None:
    memory, cells = Memory(), np.zeros(SHAPE, np.uint8)
    assert memory.push(key(4, cells))
    assert memory.push(delta(0, ("grid/key", 4), (1, 2), np.full((2, 2, 3), 7, np.uint8)))
    assert memory.push(delta(1, ("grid/delta", 0), (5, 6), np.full((2, 1, 1), 9, np.uint8)))
    expected = cells.copy()
    expected[:, 1:3, 2:5], expected[:, 5, 6] = 7, 9
    (grid,) = memory.everything()
    np.testing.assert_array_equal(grid.snapshot.arrays["cells"], expected)
    assert grid.snapshot.topic == "grid/key"
    assert grid.snapshot.fields["as_of"] == {"topic": "grid/delta", "seq": 1}
    assert cells.max() == 0, "the message that came must not change"


def test_a_gap_drops_the_grid_until_the_next_whole_one() -> None:
    memory = Memory()
    memory.push(key(0, np.zeros(SHAPE, np.uint8)))
    window = np.ones((2, 1, 1), np.uint8)
    assert not memory.push(delta(1, ("grid/delta", 0), (0, 0), window))
    assert memory.waiting_for_grid
    assert memory.everything() == []
    assert not memory.push(delta(2, ("grid/delta", 1), (0, 0), window))
    assert memory.push(key(1, np.ones(SHAPE, np.uint8)))
    assert not memory.waiting_for_grid
    assert memory.push(delta(3, ("grid/key", 1), (0, 0), window))


def test_a_window_beyond_the_grid_is_not_applied() -> None:
    for place in ((5, 6), (-1, 0), (0, 99), ("0", 0)):
        memory = Memory()
        memory.push(key(0, np.zeros(SHAPE, np.uint8)))
        assert not memory.push(delta(0, ("grid/key", 0), place, np.ones((2, 2, 2), np.uint8)))  # type: ignore[arg-type]


def test_grid_of_another_shape_or_none_is_not_shown() -> None:
    memory = Memory()
    assert not memory.push(message("grid/key", 0))
    assert not memory.push(key(0, np.zeros((3, 2, 2), np.uint8)))
    assert memory.everything() == []


def test_a_new_session_forgets_the_old_one() -> None:
    memory = Memory()
    memory.push(key(0, np.zeros(SHAPE, np.uint8)))
    memory.push(message("station", 0, stations=[]))
    memory.push(message("health", 0, session="b", ports={}))
    assert [each.snapshot.topic for each in memory.everything()] == ["health"]


def test_a_page_is_given_one_circle_of_beams_in_the_order_of_their_coming() -> None:
    memory = Memory()
    for number in range(450):
        memory.push(message("ping", number, {"echoes": np.zeros(4, np.uint8)}, bearing_deg=number * 1.8 % 360))
    assert [each.seq for each in memory.everything()] == list(range(250, 450))


def test_a_slow_reader_gets_the_newest_of_each_kind_and_no_more() -> None:
    memory = Memory()
    outbox = Outbox(memory)
    for number in range(1000):
        for each in (
            message("ping", number, {"echoes": np.zeros(4, np.uint8)}, bearing_deg=number * 1.8 % 360),
            message("health", number),
            message("mesh", number),
            message("event", number),
            key(number, np.full(SHAPE, number % 256, np.uint8)),
        ):
            memory.push(each)
            outbox.offer(each)
    assert len(outbox) == 200 + EVENTS_KEPT + 3
    got = drain(outbox)
    assert [each["seq"] for each in got if each["topic"] == "ping"] == list(range(800, 1000))
    assert [each["seq"] for each in got if each["topic"] == "event"] == list(range(1000 - EVENTS_KEPT, 1000))
    assert {each["topic"]: each["seq"] for each in got if each["topic"] in ("health", "mesh", "grid/key")} == {
        "health": 999,
        "mesh": 999,
        "grid/key": 999,
    }
    assert outbox.take() is None


def test_arrays_reach_the_browser_as_plain_bytes() -> None:
    outbox = Outbox(Memory())
    vertices = np.arange(6, dtype=np.float32).reshape(2, 3)
    triangles = np.array([[0, 1, 1]], ">u4")
    outbox.offer(message("mesh", 3, {"vertices": vertices, "triangles": triangles}))
    frame = outbox.take()
    assert frame is not None
    header, arrays = read(frame)
    assert (header["topic"], header["seq"], header["session"]) == ("mesh", 3, "a")
    np.testing.assert_array_equal(arrays[0], vertices)
    np.testing.assert_array_equal(arrays[1], triangles)


@settings(max_examples=60, deadline=None)
@given(
    st.lists(
        st.tuples(st.sampled_from("kdddgt"), st.integers(0, 5), st.integers(0, 6), st.integers(1, 255)), max_size=40
    )
)
def test_whatever_is_lost_or_slow_the_page_ends_on_the_memory(steps: list[tuple[str, int, int, int]]) -> None:
    """k a key, d a delta, g a delta of which the one before was lost, t the page reads."""
    memory = Memory()
    outbox, page = Outbox(memory), Page()
    sent, base = 0, ("grid/key", -1)
    for what, row, col, value in steps:
        if what == "t":
            page.read_all(outbox)
            continue
        if what == "g":
            base = (base[0], base[1] + 1000)
        window = np.full((2, min(2, 6 - row), min(3, 7 - col)), value, np.uint8)
        news = key(sent, np.full(SHAPE, value, np.uint8)) if what == "k" else delta(sent, base, (row, col), window)
        base, sent = (news.snapshot.topic, sent), sent + 1
        if memory.push(news):
            outbox.offer(news)
    page.read_all(outbox)
    if memory.grid is not None:
        np.testing.assert_array_equal(page.cells, memory.grid.snapshot.arrays["cells"])


class Page:
    """The grid as the browser keeps it."""

    def __init__(self) -> None:
        self.cells = np.zeros(0, np.uint8)
        self.as_of: dict[str, Any] | None = None

    def read_all(self, outbox: Outbox) -> None:
        for frame in iter(outbox.take, None):
            header, (cells,) = read(frame)
            here = {"topic": header["topic"], "seq": header["seq"]}
            if header["topic"] == "grid/key":
                self.cells, self.as_of = cells.copy(), header.get("as_of", here)
            else:
                assert header["base"] == self.as_of, "a piece that does not follow was sent"
                row, col = header["row0"], header["col0"]
                self.cells[:, row : row + cells.shape[1], col : col + cells.shape[2]] = cells
                self.as_of = here
