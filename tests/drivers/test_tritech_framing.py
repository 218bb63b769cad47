"""Frames come out of any stream, cut anyhow, and none is lost beside a damaged one."""

from __future__ import annotations

import random
from collections.abc import Sequence
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from config.errors import FrameError
from drivers.tritech.framing import _STALE, GRACE_NS, Deframer, Frame, wrap, wrap_command, wrap_reply
from drivers.tritech.ids import REWRITING, MessageId, name_of
from drivers.tritech.sizes import LARGEST

ALIVE = wrap_reply(MessageId.ALIVE, bytes(7) + b"\x4a")
Outcome = tuple[list[Frame], int, dict[str, int]]


def head_data(bins: bytes, bearing: int = 3200) -> bytes:
    header = (31 + len(bins)).to_bytes(2, "little") + bytes(25) + bearing.to_bytes(2, "little")
    return wrap_reply(MessageId.HEAD_DATA, header + len(bins).to_bytes(2, "little") + bins)


def run(pieces: Sequence[tuple[int, bytes]]) -> Outcome:
    deframer = Deframer()
    frames = [frame for t_ns, data in pieces for frame in deframer.push(t_ns, data)]
    frames += deframer.finish()
    assert deframer.pending == 0
    assert deframer.skipped + sum(len(frame.data) for frame in frames) == sum(len(data) for _, data in pieces)
    return frames, deframer.skipped, dict(deframer.bad)


def bytewise(pieces: Sequence[tuple[int, bytes]]) -> list[tuple[int, bytes]]:
    return [(t_ns, data[i : i + 1]) for t_ns, data in pieces for i in range(len(data))]


def joined(pieces: Sequence[tuple[int, bytes]]) -> list[tuple[int, bytes]]:
    """Join neighbours of one time."""
    whole: list[tuple[int, bytes]] = []
    for t_ns, data in pieces:
        if whole and whole[-1][0] == t_ns:
            whole[-1] = (t_ns, whole[-1][1] + data)
        else:
            whole.append((t_ns, data))
    return whole


def test_real_stream(shared_data: Path) -> None:
    stream = (shared_data / "sonar" / "micron_dst_stream_20171102.bin").read_bytes()
    deframer = Deframer()
    frames = deframer.push(5, stream)
    assert (len(frames), deframer.skipped, deframer.pending) == (765, 24, 29)
    assert deframer.finish() == []
    assert (deframer.skipped, deframer.pending, dict(deframer.bad)) == (53, 0, {})
    assert {(frame.message_id, frame.source, frame.destination, frame.t_ns) for frame in frames} == {(2, 2, 255, 5)}
    assert run(bytewise([(5, stream)])) == (frames, 53, {})


def test_frames_carry_the_time_of_their_first_byte() -> None:
    stream = [(10, b"xx" + ALIVE[:3]), (20, ALIVE[3:] + ALIVE[:1]), (30, ALIVE[1:])]
    frames, skipped, bad = run(stream)
    assert [frame.t_ns for frame in frames] == [10, 20]
    assert (skipped, bad) == (2, {})
    assert run([]) == ([], 0, {})


@pytest.mark.parametrize(
    "inner", [b"\n@", b"@0010\x10\x00", b"\n@0341A\x03\x02\xff\x00\x02\x80\x02", b"@" * 40, b"\n" * 40]
)
def test_echoes_may_look_like_frames(inner: bytes) -> None:
    frame = head_data(b"\x07" * 20 + inner + b"\x01" * 9)
    assert [each.data for each in run([(0, frame + ALIVE)])[0]] == [frame, ALIVE]


@pytest.mark.parametrize(
    ("at", "value", "reason"),
    [
        (5, 0x11, "length"),
        (12, 9, "node"),
        (10, MessageId.VERSION_DATA, "size"),
        (21, 0x0B, "end"),
        (4, ord("1"), "length"),
    ],
)
def test_contradictions_are_refused(at: int, value: int, reason: str) -> None:
    broken = bytearray(ALIVE)
    broken[at] = value
    frames, skipped, bad = run([(0, bytes(broken) + ALIVE)])
    assert [frame.data for frame in frames] == [ALIVE]
    assert (skipped, bad) == (22, {reason: 1})


@pytest.mark.parametrize("message", [MessageId.AUX_DATA, MessageId.HEAD_DATA, MessageId.HEAD_COMMAND])
def test_a_message_without_its_count_is_refused(message: MessageId) -> None:
    empty = wrap_reply(message, b"")
    assert run([(0, empty + ALIVE)]) == run(bytewise([(0, empty + ALIVE)]))
    assert run([(0, empty)]) == ([], 14, {"size": 1})


def test_lower_case_lengths_are_accepted() -> None:
    frame = head_data(bytes(700)).replace(b"@02E3", b"@02e3")
    assert frame.startswith(b"@02e3")
    assert [each.data for each in run([(0, frame)])[0]] == [frame]


def test_a_false_beginning_holds_real_frames_only_for_a_while() -> None:
    deframer = Deframer()
    liar = head_data(bytes(1500))[:44]
    assert deframer.push(0, liar + ALIVE) == []
    assert deframer.expire(GRACE_NS) == []
    assert [frame.data for frame in deframer.expire(2 * GRACE_NS)] == [ALIVE]
    assert (deframer.bad["late"], deframer.skipped, deframer.pending) == (1, 44, 0)
    assert deframer.expire(9 * GRACE_NS) == []


def test_expiring_changes_neither_frames_nor_their_times() -> None:
    liar = head_data(bytes(1500))[:44]
    pieces = [(0, liar + ALIVE), (3 * GRACE_NS, ALIVE), (3 * GRACE_NS + 9, ALIVE)]
    expiring = Deframer()
    frames = []
    for t_ns, data in pieces:
        frames += expiring.expire(t_ns - 1) + expiring.push(t_ns, data)
    assert (frames, expiring.skipped, dict(expiring.bad)) == run(pieces)
    assert [frame.t_ns for frame in frames] == [t_ns for t_ns, _ in pieces]


def test_bytes_lost_within_a_frame_cost_only_that_frame() -> None:
    frames = [head_data(bytes([i]) * 700, bearing=i) for i in range(1, 9)]
    stream = b"".join(frames[:3]) + frames[3][:200] + frames[3][300:] + b"".join(frames[4:])
    got, skipped, bad = run([(0, stream)])
    assert [frame.data for frame in got] == frames[:3] + frames[4:]
    assert (skipped, bad) == (645, {"end": 1})


def test_memory_is_bounded_by_one_frame() -> None:
    liar = head_data(bytes(LARGEST - 45))[:60]
    for garbage in (b"@" * 20_000, b"@000", liar * 300, b"@0FFA\xfa\x0f" * 3000):
        deframer = Deframer()
        for i in range(0, len(garbage), 50):
            deframer.push(i, garbage[i : i + 50])
            assert deframer.pending <= LARGEST
            assert len(deframer._times) <= LARGEST + _STALE


def test_undamaged_frames_survive_one_percent_of_damage() -> None:
    generator = random.Random(20171102)
    sent, stream = [], bytearray()
    for index in range(2000):
        frame = bytearray(head_data(generator.randbytes(generator.choice((200, 400, 794))), bearing=index))
        if generator.random() < 0.01:
            for _ in range(generator.randrange(1, 30)):
                frame[generator.randrange(len(frame))] = generator.randrange(256)
            cut = generator.randrange(len(frame))
            del frame[cut : cut + generator.choice((0, 0, 1, 40))]
        else:
            sent.append(bytes(frame))
        stream += frame
    got = [frame.data for frame in run([(0, bytes(stream))])[0]]
    assert len(sent) > 1950
    assert [frame for frame in got if frame in set(sent)] == sent


NOISE = st.one_of(
    st.binary(max_size=40),
    st.lists(
        st.sampled_from([b"@", b"@00", b"@0010", b"\n", b"@0010\x10\x00\x02\xff\x0b\x04\x80\x02", b"F"]), max_size=20
    ).map(b"".join),
)
SOUND = st.one_of(st.just(ALIVE), st.binary(max_size=60).map(head_data), st.just(head_data(b"\n@0010" * 30)))


@st.composite
def timed_streams(draw: st.DrawFn) -> list[tuple[int, bytes]]:
    """Frames and noise, cut anywhere, with pauses of which some are too long."""
    stream = b"".join(draw(st.lists(st.one_of(SOUND, NOISE), max_size=8)))
    cuts = sorted(draw(st.lists(st.integers(0, len(stream)), max_size=8)))
    edges = [0, *cuts, len(stream)]
    pauses = draw(
        st.lists(st.sampled_from([0, 1, GRACE_NS // 2, 2 * GRACE_NS]), min_size=len(edges), max_size=len(edges))
    )
    t_ns, pieces = 0, []
    for start, end, pause in zip(edges, edges[1:], pauses, strict=False):
        t_ns += pause
        pieces.append((t_ns, stream[start:end]))
    return pieces


@settings(max_examples=300, deadline=None)
@given(timed_streams())
def test_any_pieces_give_the_same(pieces: list[tuple[int, bytes]]) -> None:
    whole = run(joined(pieces))
    assert run(pieces) == whole
    assert run(bytewise(pieces)) == whole


@settings(max_examples=100, deadline=None)
@given(st.binary(max_size=3000))
def test_noise_never_raises(data: bytes) -> None:
    run([(0, data)])


@pytest.mark.parametrize("message_id", sorted(REWRITING))
def test_frames_that_rewrite_a_head_cannot_be_built(message_id: int) -> None:
    with pytest.raises(FrameError, match="rewrites the head"):
        wrap(message_id, b"", 255, 2, 2)
    assert name_of(message_id) == f"id_{message_id}"


def test_too_long_a_message_is_refused() -> None:
    with pytest.raises(FrameError, match="does not fit"):
        wrap_command(MessageId.NULL, bytes(5000))
