"""What people see of the plan: its classes, fills, stations and pieces, in a real Chromium."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from playwright.sync_api import Page, expect

from tests.tools.fake_site import PIECE_M, PIECE_WALL_Y_M
from tests.tools.sight import near, on_plan, orange, picture

PIECE = (122, 47, 208)
WALL, FREE, UNKNOWN = (11, 15, 19), (207, 216, 222), (89, 99, 109)


def test_plan_shows_wall_water_unknown_and_fill_where_they_are(page: Page) -> None:
    def colour(x_m: float, y_m: float) -> NDArray[np.uint8]:
        px, py = on_plan(page, x_m, y_m)
        return picture(page.locator("#plan"))[py - 1 : py + 2, px - 1 : px + 2]

    assert near(colour(-3.0, 1.0), WALL).all()
    assert near(colour(0.5, -1.2), FREE).all()
    assert near(colour(-3.6, 0.5), UNKNOWN).all()
    px, py = on_plan(page, 4.1, 0.0)
    fill = picture(page.locator("#plan"))[py - 3 : py + 4, px - 12 : px + 13]
    assert not near(fill, WALL).any(), "a fill must not look measured"
    assert 0.1 < orange(fill).mean() < 0.9, "a fill is hatched"


def test_a_surer_fill_is_stronger(page: Page) -> None:
    def strength(x_m: float, y_m: float) -> float:
        px, py = on_plan(page, x_m, y_m)
        fill = picture(page.locator("#plan"))[py - 4 : py + 5, px - 8 : px + 9].astype(float)
        return float(255 - np.percentile(fill[..., 2], 10))

    assert strength(4.1, 0.0) > strength(-2.0, 3.1) + 30


def test_the_pointer_tells_coordinates_evidence_fills_and_stations(page: Page) -> None:
    def under(x_m: float, y_m: float) -> str:
        px, py = on_plan(page, x_m, y_m)
        page.locator("#plan").hover(position={"x": px, "y": py})
        page.wait_for_timeout(150)
        return page.locator("#plan-readout").inner_text()

    assert "open water, measured, occupied 10 %" in under(0.5, -1.2)
    assert "filled in, certainty" in under(4.1, 0.0)
    assert "both walls are straight" in under(4.1, 0.0)
    assert "station 2 placed" in under(1.6, 1.9)
    assert "closes the hole" in under(-2.2, 2.0)


def test_an_unplaced_station_says_why(page: Page) -> None:
    expect(page.locator("#outside")).to_contain_text(
        "Station 4 unplaced: two places fit equally well, 3.1 m apart along 090°"
    )
    expect(page.locator("#outside")).to_contain_text("Station 3 doubtful")


def test_a_floating_piece_is_told_apart_from_the_map(page: Page) -> None:
    expect(page.locator("#outside")).to_contain_text("Piece 6 not tied yet: stations 5, 6 hold together")
    expect(page.locator("#outside")).not_to_contain_text("Station 5")
    expect(page.locator("#legend-piece")).to_be_visible()
    (x0, y0), (x1, y1) = PIECE_M
    left, bottom = on_plan(page, x0 - 0.6, y0 - 0.6)
    right, top = on_plan(page, x1 + 0.6, y1 + 0.6)
    pixels = picture(page.locator("#plan"))
    is_piece = near(pixels, PIECE, 24)
    assert is_piece[top:bottom, left:right].sum() > 60
    assert not is_piece[bottom:].any(), "nothing of the map has this colour"
    wall = slice(*(on_plan(page, 5.0, PIECE_WALL_Y_M + away)[1] for away in (0.1, -0.1)))
    assert is_piece[wall, on_plan(page, 4.1, 0.0)[0] : on_plan(page, 5.9, 0.0)[0]].any(axis=0).mean() > 0.3
    px, py = on_plan(page, x0, y0)
    page.locator("#plan").hover(position={"x": px, "y": py})
    expect(page.locator("#plan-readout")).to_contain_text("station 5 of piece 6, not tied yet: its place is a guess")
    page.keyboard.press("2")
    expect(page.locator("#legend-piece")).to_be_hidden()
