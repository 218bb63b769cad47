"""The conversation reaches scanning, keeps a head busy, and recovers from what heads and lines do."""

from __future__ import annotations

from collections import Counter

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drivers.tritech import commands
from drivers.tritech.framing import Deframer
from drivers.tritech.head import Head
from drivers.tritech.headdata import HeadStatus
from drivers.tritech.messages import Alive, VersionData, encode, user_block
from drivers.tritech.settings import head_command
from drivers.tritech.states import STEPS, TRANSITIONS, State
from tests.drivers.scripted_head import CENTRED, CENTRING, READY, SECOND, SONAR, Line, ScriptedHead


def test_from_power_up_to_scanning() -> None:
    line = Line().run(10)
    assert line.states == ["centring", "version", "user_block", "setting", "scanning"]
    assert [type(command) for command in line.scripted.log[:4]] == [
        commands.SendVersion,
        commands.SendBBUser,
        commands.HeadCommand,
        commands.SendData,
    ]
    assert line.scripted.log[2] == head_command(SONAR)
    assert (line.head.version, line.head.user_block) == (VersionData(0x31), user_block())
    # Two pings a request, one each 50 ms, without a pause longer than a tick or two.
    assert line.scripted.pings > 0.7 * 5 * 20
    assert line.scripted.count(commands.SendData) == pytest.approx(line.scripted.pings / 2, abs=1)


@pytest.mark.parametrize(
    "scripted",
    [
        ScriptedHead(answers_version=False),
        ScriptedHead(answers_block=False),
        ScriptedHead(alives=False),
        ScriptedHead(half_duplex=True, pings_per_request=1),
        ScriptedHead(pings_per_request=1),
        ScriptedHead(parameters=head_command(SONAR).parameters),
    ],
    ids=["no version", "no user block", "no alives", "half duplex", "one ping a request", "set before"],
)
def test_heads_that_differ(scripted: ScriptedHead) -> None:
    line = Line(scripted).run(20)
    assert line.head.state == "scanning"
    before = scripted.pings
    line.run(10)
    assert scripted.pings - before > 120
    assert scripted.count(commands.ReBoot) == 0


def test_requests_do_not_pile_up() -> None:
    line = Line().run(30)
    assert len(line.scripted.queue) <= 2
    single = Line(ScriptedHead(pings_per_request=1)).run(30)
    assert len(single.scripted.queue) <= 1


def test_the_next_request_goes_out_while_a_ping_is_still_to_come() -> None:
    head = Head(SONAR)
    head.push(SECOND, encode(Alive(READY)))
    ping = ScriptedHead().ping(head_command(SONAR).parameters)
    head.push(2 * SECOND, encode(VersionData(1)))
    head.push(3 * SECOND, encode(user_block()))
    ask = commands.encode_command(commands.SendData())
    assert head.push(4 * SECOND, encode(Alive(READY))) == ask
    assert [head.push(4 * SECOND + i, ping) for i in range(1, 7)] == [ask, b"", ask, b"", ask, b""]
    assert head.push(5 * SECOND, ping + ping) == ask


def test_nothing_is_sent_before_there_was_time_to_listen() -> None:
    head = Head(SONAR)
    assert head.tick(5 * SECOND) == b""
    assert head.tick(7 * SECOND) == b""
    assert head.tick(8 * SECOND) == commands.encode_command(commands.SendVersion())
    assert head.state == "silent"


def test_a_dead_head_is_asked_and_rebooted_once_a_minute() -> None:
    line = Line(ScriptedHead(dead=True)).run(140)
    sent = Counter(type(command) for command in line.scripted.log)
    assert set(sent) == {commands.SendVersion, commands.ReBoot}
    assert (sent[commands.ReBoot], line.head.state) == (2, "silent")
    line.scripted.dead = False
    line.run(15)
    assert line.head.state == "scanning"


def test_damaged_frames_cost_little() -> None:
    line = Line().run(10)
    before = line.scripted.pings
    line.run(60, drop_every=100)
    assert line.head.state == "scanning"
    assert line.scripted.pings - before > 0.6 * 60 * 20
    assert line.head._requests.pings_per_request == 2


def test_unplugged_and_plugged_again() -> None:
    line = Line().run(10)
    line.scripted.dead = True
    line.run(30)
    assert line.head.state == "silent"
    line.scripted.dead = False
    line.run(10)
    assert line.head.state == "scanning"


def test_power_loss_is_answered_with_the_settings() -> None:
    line = Line().run(10)
    line.scripted.status = HeadStatus(0x11)
    line.states.clear()
    line.run(5)
    assert line.states == ["scanning", "setting", "scanning"]
    assert line.scripted.count(commands.HeadCommand) == 2
    assert line.scripted.count(commands.ReBoot) == 0


def test_one_ping_that_tells_of_a_loss_may_be_noise() -> None:
    line = Line().run(10)
    line.scripted.status = HeadStatus(0x11)
    noisy = line.scripted.ping(head_command(SONAR).parameters)
    line.scripted.status = HeadStatus.FULL_RANGE_8_BIT
    for _ in range(5):
        line.head.push(line.t_ns, noisy)
        line.run(1)
    assert line.scripted.count(commands.HeadCommand) == 1


def test_a_motor_that_stays_lost_reboots_the_head() -> None:
    line = Line().run(10)
    broken = HeadStatus(0x12)
    for _ in range(400):
        line.scripted.status = broken
        line.run(0.05)
        if line.scripted.count(commands.ReBoot):
            break
    assert line.scripted.count(commands.HeadCommand) >= 3
    assert line.scripted.count(commands.ReBoot) == 1
    line.scripted.status = HeadStatus.FULL_RANGE_8_BIT
    line.run(15)
    assert line.head.state == "scanning"


def test_a_head_that_restarts_gets_everything_again() -> None:
    line = Line().run(10)
    line.scripted.parameters, line.scripted.queue = None, []
    line.scripted.centres_at = line.t_ns + 3 * SECOND
    line.states.clear()
    line.run(12)
    assert line.states[-5:] == ["centring", "version", "user_block", "setting", "scanning"]


def test_a_head_that_refuses_its_settings_is_rebooted() -> None:
    line = Line(ScriptedHead(takes_settings=False)).run(40)
    assert line.scripted.count(commands.ReBoot) == 1
    assert line.head.state == "scanning"


def test_settings_change_and_old_pings_are_let_through() -> None:
    line = Line().run(10)
    longer = SONAR.model_copy(update={"range_m": 20.0})
    line.head.change(longer)
    assert line.head.sonar == longer
    line.run(5)
    assert line.head.state == "scanning"
    assert line.scripted.parameters == head_command(longer).parameters
    assert line.scripted.count(commands.HeadCommand) == 2
    assert not line.head.settings_differ


@pytest.mark.parametrize("answers", [True, False])
def test_half_duplex_settings_wait_for_the_ping_under_way(answers: bool) -> None:
    line = Line(ScriptedHead(half_duplex=True, pings_per_request=1)).run(10)
    while not line.scripted.queue:
        line.run(0.01)
    if not answers:
        line.scripted.queue = []
    longer = SONAR.model_copy(update={"range_m": 20.0})
    line.head.change(longer)
    line.run(0.01)
    assert line.scripted.count(commands.HeadCommand) == 1
    line.run(3)
    assert (line.head.state, line.scripted.parameters) == ("scanning", head_command(longer).parameters)


def test_a_head_with_a_will_of_its_own_is_taken_as_it_is() -> None:
    line = Line(ScriptedHead(own_step=16)).run(60)
    assert (line.head.state, line.head.settings_differ) == ("scanning", True)
    assert line.scripted.count(commands.HeadCommand) == 3
    before = line.scripted.pings
    line.run(10)
    assert line.scripted.pings - before > 120


def test_stop_leaves_the_head_idle_and_start_goes_on() -> None:
    line = Line().run(10)
    line.head.stop()
    line.run(1)
    asked = len(line.scripted.log)
    line.run(30)
    assert (line.head.state, len(line.scripted.log)) == ("stopped", asked)
    line.head.change(SONAR.model_copy(update={"gain_pct": 10.0}))
    line.run(5)
    assert line.head.state == "stopped"
    line.head.start()
    line.run(5)
    assert line.head.state == "scanning"
    assert line.scripted.parameters is not None
    assert line.scripted.parameters.gain_1 == 21


def test_other_nodes_are_not_heard() -> None:
    head = Head(SONAR)
    head.push(SECOND, encode(Alive(CENTRED), head=3))
    assert head.state == "silent"
    assert head.push(2 * SECOND, encode(Alive(CENTRED))) == commands.encode_command(commands.SendVersion())
    assert head.state == "version"


def test_the_table_is_whole() -> None:
    assert set(STEPS) == set(State)
    assert {state for state, _ in TRANSITIONS} | {State.STOPPED} == set(State)
    reached = set(TRANSITIONS.values()) | {step.then for step in STEPS.values()}
    assert reached == set(State)


@settings(max_examples=100, deadline=None)
@given(
    st.lists(
        st.one_of(
            st.binary(max_size=20),
            st.sampled_from(
                [encode(Alive(CENTRING)), encode(Alive(CENTRED)), encode(Alive(READY)), encode(VersionData(1))]
            ),
            st.sampled_from([encode(user_block()), ScriptedHead().ping(head_command(SONAR).parameters)]),
        ),
        max_size=30,
    ),
    st.integers(1, 3 * SECOND),
)
def test_anything_may_be_heard(pieces: list[bytes], pause: int) -> None:
    head, deframer = Head(SONAR), Deframer()
    sent = b""
    for index, data in enumerate(pieces):
        sent += head.push(index * pause, data) + head.tick(index * pause + pause // 2)
    frames = deframer.push(0, sent)
    assert b"".join(frame.data for frame in frames) == sent
    assert all(commands.decode_command(frame) for frame in frames)
    assert head.state in {state.value for state in State}
