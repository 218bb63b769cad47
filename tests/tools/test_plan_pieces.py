"""Floating pieces on the drawn plan: dashed, apart from the map's stations, named in the legend."""

from __future__ import annotations

import io
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from config.schema import Config
from mapping.values import Outline, Station
from tests.tools import fake_site
from tools.plan import Plan, draw_plan
from tools.plan_pieces import PIECE, pieces_of, room_for
from tools.provenance import provenance


def plan(stations: list[Station], outlines: Sequence[Outline] = ()) -> Plan:
    origin = provenance(Config(), ("dive.mcap",), {})
    return draw_plan(fake_site.filled(*fake_site.grid()), stations, origin, outlines)


def violet(drawn: Plan, x_m: tuple[float, float], y_m: tuple[float, float]) -> NDArray[np.bool_]:
    """Where the pixels of a part of the map have the colour of pieces."""
    size, _, _, down, west, north = (float(line) for line in drawn.world.split())
    columns, rows = [round((x - west) / size) for x in x_m], [round((y - north) / down) for y in y_m]
    pixels = np.asarray(Image.open(io.BytesIO(drawn.png)).convert("RGB"))[rows[1] : rows[0], columns[0] : columns[1]]
    return np.asarray((np.abs(pixels.astype(int) - PIECE) < 40).all(axis=-1))


def test_only_stations_that_hold_together_are_a_piece() -> None:
    stations = fake_site.stations()
    assert {number: [s.scan.index for s in members] for number, members in pieces_of(stations).items()} == {6: [5, 6]}
    dropped = [replace(s, status="dropped") if s.scan.index == 6 else s for s in stations]
    assert pieces_of(dropped) == {}


def test_a_piece_is_drawn_dashed_about_its_stations_and_nowhere_else() -> None:
    drawn = plan(fake_site.stations())
    (x0, y0), (x1, y1) = fake_site.PIECE_M
    here = violet(drawn, (x0 - 0.5, x1 + 0.5), (y0 - 0.5, y1 + 0.5))
    assert here.sum() > 200
    assert not violet(drawn, (-3.0, 3.0), (-2.0, 3.0)).any()
    # Dashes: of the straight side between two stations some is drawn and some is not.
    along = violet(drawn, (4.7, 5.3), (2.4, 2.8)).any(axis=0)
    assert 0.2 < along.mean() < 1.0


def test_what_a_piece_saw_of_walls_is_dotted_and_has_room() -> None:
    drawn = plan(fake_site.stations(), fake_site.outlines())
    y = fake_site.PIECE_WALL_Y_M
    assert violet(drawn, (4.0, 6.0), (y - 0.1, y + 0.1)).any(axis=0).mean() > 0.3
    assert not violet(drawn, (-3.0, 3.0), (-2.0, 3.0)).any()


def test_a_map_in_one_piece_has_no_such_colour() -> None:
    drawn = plan([each for each in fake_site.stations() if each.piece != 6])
    pixels = np.asarray(Image.open(io.BytesIO(drawn.png)).convert("RGB")).astype(int)
    assert not (np.abs(pixels - PIECE) < 40).all(axis=-1).any()


def test_the_frame_holds_pieces_far_off_and_the_legend_all_names() -> None:
    stations = fake_site.stations()
    two = [each for each in stations if each.piece == 6]
    number = range(10, 50, 2)
    many = [replace(s, piece=n, scan=replace(s.scan, index=n + k)) for n in number for k, s in enumerate(two)]
    far = [replace(s, pose=replace(s.pose, x_m=s.pose.x_m + 20.0)) for s in many]
    drawn, before = plan([*stations, *far]), plan(stations)
    assert violet(drawn, (24.0, 26.0), (2.0, 3.2)).sum() > 100
    assert Image.open(io.BytesIO(drawn.png)).width != Image.open(io.BytesIO(before.png)).width
    assert Image.open(io.BytesIO(drawn.png)).height > 350 + 18 * len(number)
    assert room_for({}, (), 0.05).shape == (0, 2)
