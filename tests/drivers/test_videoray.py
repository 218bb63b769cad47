"""Replies of VideoRay vehicles, Pro 3 and Pro 4, become headings and depths; nothing but harmless requests is sent."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from config.schema import Feed, Site
from drivers.polls import Poller
from drivers.statements import Meaning, Statement
from drivers.videoray_pro3 import Pro3, pro3_reader
from drivers.videoray_pro4 import NAVIGATION_REQUEST, navigation_request, pro4_reader
from tests.drivers.feedframes import PRO3_REQUEST, pro3_reply, pro4_crc_packet, pro4_navigation, pro4_packet, pro4_words
from tests.drivers.feedkit import CUTS, assert_any_cut_is_the_same, opinions, plain, run

PRO3 = Feed(driver="videoray_pro3", port="/dev/p", depth_points=((1017, 0.0), (313, 34.2)), max_turn_deg_s=3600)
STEADY = PRO3.model_copy(update={"max_dive_m_s": 100.0})
PRO4 = Feed(driver="videoray_pro4", port="/dev/p", surface_mbar=1013.25)


def pro3_vectors(shared_data: Path) -> list[bytes]:
    lines = (shared_data / "feeds" / "videoray_pro3_synthetic.hex").read_text().splitlines()[1:]
    return [bytes.fromhex(line.split("\t")[0]) for line in lines]


@pytest.mark.parametrize(
    ("index", "heading_deg", "count"),
    [
        (1, 0, 1017),  # orientation 270
        (2, 45, 900),  # 225
        (3, 90, 700),  # 180
        (4, 180, 512),  # 90
        (5, 270, 313),  # 0
        (6, 359, 116),  # 271: just below north, the other way round
    ],
)
def test_replies_of_a_pro_3(shared_data: Path, index: int, heading_deg: int, count: int) -> None:
    frame = pro3_vectors(shared_data)[index]
    vehicle = Pro3(PRO3)
    name, statements = vehicle.read(frame)
    assert (name, vehicle.count) == ("reply", count)
    assert statements[0] == Statement(Meaning.MAGNETIC, heading_deg)
    readings, counters = run(PRO3, [(0, frame + PRO3_REQUEST * 2)])
    depth_m = 34.2 * (1017 - count) / (1017 - 313)
    assert [plain(each) for each in readings] == [("heading", heading_deg), ("depth", round(depth_m, 6))]
    assert counters.frames == {"reply": 1, "request": 2}


def test_all_of_a_pro_3_on_one_line(shared_data: Path) -> None:
    frames = pro3_vectors(shared_data)
    assert len(frames) == 7
    wire = b"".join(PRO3_REQUEST + each for each in frames[1:]) + PRO3_REQUEST
    readings, counters = run(PRO3.model_copy(update={"provides": ("heading",)}), [(0, wire)])
    assert counters.frames == {"reply": 6, "request": 7}
    assert counters.skipped_bytes == 0
    assert [plain(each)[1] for each in readings] == [0, 45, 90, 180, 270, 359]


def test_an_uncalibrated_pro_3_tells_headings_only() -> None:
    feed = PRO3.model_copy(update={"depth_points": None})
    readings, _ = run(feed, [(0, pro3_reply(90, 500) * 2)], Site(declination_deg=4.0))
    assert [plain(each) for each in readings] == [("heading", 184.0)] * 2


def test_a_lone_pro_3_reply_is_not_believed_and_a_followed_one_is() -> None:
    assert run(PRO3, [(0, b"\x31\x02" + pro3_reply(90, 500))])[0] == []
    readings, counters = run(STEADY, [(0, b"\x31\x02" + pro3_reply(90, 500) + pro3_reply(91, 500))])
    assert [plain(each)[1] for each in readings if plain(each)[0] == "heading"] == [180, 179]
    assert counters.skipped_bytes == 2


@pytest.mark.parametrize("lost", range(7))
@pytest.mark.parametrize("after", [pro3_reply(91, 500), PRO3_REQUEST])
def test_a_lost_byte_costs_one_pro_3_reply(lost: int, after: bytes) -> None:
    whole = pro3_reply(90, 500)
    wire = whole * 3 + whole[:lost] + whole[lost + 1 :] + after + whole * 2
    readings, _ = run(PRO3.model_copy(update={"provides": ("heading",)}), [(0, wire)])
    headings = [plain(each)[1] for each in readings]
    assert headings == [180] * 3 + [179] * (after != PRO3_REQUEST) + [180] * 2


@pytest.mark.parametrize("frame", [pro3_reply(360, 500), pro3_reply(90, 1024), b"\x28\x32" + bytes(5)])
def test_implausible_pro_3_replies_are_refused(frame: bytes) -> None:
    readings, counters = run(PRO3, [(0, pro3_reply(90, 500) * 2 + frame + pro3_reply(90, 500) * 2)])
    assert len(readings) == 2 * 4
    assert counters.skipped_bytes == 7


def pro4_packets(shared_data: Path) -> list[bytes]:
    lines = (shared_data / "feeds" / "videoray_pro4_doc_packets.hex").read_text().splitlines()[1:]
    return [bytes.fromhex(line) for line in lines]


@pytest.mark.parametrize(
    ("index", "name", "heading_deg"),
    [
        (0, "navigation", 49.4),
        (1, "request", None),
        (2, "other", None),  # names of the boards
        (3, "request", None),
        (4, "registers", 49.4),  # EE 01 stands at address 68
        (5, "request", None),
        (6, "navigation", 49.3),
        (7, "request", None),
        (8, "registers", 360 - 13.2),  # 7C FF: -132 tenths
        (9, "request", None),
    ],
)
def test_packets_of_the_maker_s_document(shared_data: Path, index: int, name: str, heading_deg: float | None) -> None:
    readings, counters = run(PRO4, [(0, pro4_packets(shared_data)[index])])
    assert (counters.frames, counters.skipped_bytes) == ({name: 1}, 0)
    headings = [plain(each)[1] for each in readings if plain(each)[0] == "heading"]
    assert headings == ([] if heading_deg is None else [pytest.approx(heading_deg)])


def test_every_packet_of_the_document_on_one_line(shared_data: Path) -> None:
    packets = pro4_packets(shared_data)
    assert len(packets) == 10
    readings, counters = run(PRO4, [(0, b"".join(packets))])
    assert (sum(counters.frames.values()), counters.skipped_bytes, counters.bad) == (10, 0, {})
    # The boards were dry and without a sensor: 0 mbar is no depth.
    depths = opinions([each for each in readings if plain(each)[0] == "depth"])
    assert depths == [("bad", "0 mbar is less than any air: no pressure sensor?")] * 4


@pytest.mark.parametrize("flags", [1, 2, 3, 4, 5])
def test_heading_and_depth_of_a_pro_4(flags: int) -> None:
    readings, _ = run(PRO4, [(0, pro4_navigation(-132, 1313, flags))], Site(declination_deg=3.9))
    depth_m = round((1313 - 1013.25) * 100 / (997 * 9.80665), 6)
    assert [plain(each) for each in readings] == [("heading", 350.7), ("depth", depth_m)]


def test_units_of_early_firmware_and_registers_elsewhere() -> None:
    early = PRO4.model_copy(update={"angle_unit": "deg"})
    assert plain(run(early, [(0, pro4_navigation(274, 1100))])[0][0]) == ("heading", 274.0)
    assert run(early, [(0, pro4_navigation(2740, 1100))])[1].bad == {"field": 1}
    words = (1100).to_bytes(2, "little") + (1234).to_bytes(2, "little")
    assert plain(run(PRO4, [(0, pro4_packet(0x88, 0x66, b"\x01" + words + bytes(4)))])[0][0]) == ("heading", 123.4)
    assert run(PRO4, [(0, pro4_packet(0x88, 0x67, b"\x01" + words + bytes(4)))])[0] == []
    assert run(PRO4, [(0, pro4_packet(0x82, 0x66, b"\x01" + words[:2]))])[1].frames == {"other": 1}
    assert run(PRO4, [(0, pro4_packet(2, 0, b"\x02" + bytes(8)))])[1].frames == {"other": 1}
    assert run(PRO4, [(0, pro4_packet(2, 0, b""))])[1].frames == {"other": 1}


@pytest.mark.parametrize("index", [0, 2, 5, 6, 8, 16])
def test_a_damaged_packet_is_refused_and_the_next_one_read(index: int) -> None:
    broken = bytearray(pro4_navigation(100, 1100))
    broken[index] ^= 0x11
    readings, counters = run(PRO4, [(0, bytes(broken) + pro4_navigation(200, 1100))])
    assert [plain(each)[1] for each in readings][:1] == [20.0]
    assert counters.skipped_bytes == 17


def test_only_the_request_without_data_is_ever_sent() -> None:
    assert pro4_packet(5, 0, b"", b"\xfa\xaf") == NAVIGATION_REQUEST
    assert Poller(PRO4).tick(0) == b""
    assert Poller(PRO3.model_copy(update={"poll": True})).tick(0) == b""
    poller = Poller(PRO4.model_copy(update={"poll": True, "poll_hz": 10.0}))
    sent = [poller.tick(t_ms * 1_000_000) for t_ms in range(0, 1000, 20)]
    assert set(sent) == {b"", NAVIGATION_REQUEST}
    assert sent.count(NAVIGATION_REQUEST) == 10


def test_newer_vehicles_check_their_packets_by_crc_32() -> None:
    packet = pro4_crc_packet(5, 0, pro4_words(-132, 1313))
    readings, counters = run(PRO4, [(0, packet + pro4_navigation(10, 1100))], Site(declination_deg=3.9))
    assert plain(readings[0]) == ("heading", 350.7)
    assert (counters.frames, counters.skipped_bytes) == ({"navigation": 2}, 0)
    for index in range(len(packet)):
        broken = bytearray(packet)
        broken[index] ^= 0x11
        readings, counters = run(PRO4, [(0, bytes(broken) + packet)])
        assert len(readings) == 2
        assert counters.skipped_bytes == len(packet)
    request = navigation_request(crc=True)
    assert request == pro4_crc_packet(5, 0, b"", b"\xf5\x5f")
    assert run(PRO4, [(0, request)])[1].frames == {"request": 1}
    poller = Poller(PRO4.model_copy(update={"poll": True, "crc32": True}))
    assert poller.tick(0) == request


PRO3_PIECES = st.lists(
    st.sampled_from(
        [pro3_reply(90, 500), pro3_reply(10, 900), PRO3_REQUEST, b"\x28\x31", b"\x28", pro3_reply(1, 1)[:5]]
    )
    | st.binary(max_size=4),
    max_size=12,
).map(b"".join)
PRO4_PIECES = st.lists(
    st.sampled_from(
        [
            pro4_navigation(100, 1100),
            pro4_navigation(-100, 1200),
            NAVIGATION_REQUEST,
            pro4_packet(0, 0, bytes(300)),
            pro4_crc_packet(2, 0, pro4_words(50, 1300)),
            b"\xfd",
        ]
    )
    | st.binary(max_size=4),
    max_size=8,
).map(b"".join)


@settings(max_examples=100, deadline=None)
@given(PRO3_PIECES, CUTS)
def test_any_pieces_of_a_pro_3_give_the_same(data: bytes, cuts: list[int]) -> None:
    assert_any_cut_is_the_same(PRO3, data, cuts)


@settings(max_examples=60, deadline=None)
@given(PRO4_PIECES, CUTS)
def test_any_pieces_of_a_pro_4_give_the_same(data: bytes, cuts: list[int]) -> None:
    assert_any_cut_is_the_same(PRO4, data, cuts)


@settings(max_examples=50, deadline=None)
@given(st.binary(max_size=5000))
def test_garbage_is_not_kept(data: bytes) -> None:
    pro3, pro4 = pro3_reader(PRO3), pro4_reader(PRO4)
    pro3.push(0, data)
    pro4.push(0, data)
    assert pro3.pending <= 10
    assert pro4.pending <= 4096 + 11
    assert pro3.finish() == []
    pro4.finish()
    assert pro3.pending == pro4.pending == 0
