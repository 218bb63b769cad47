"""What people see: the page in a real Chromium, looked at by its words and its pixels."""

from __future__ import annotations

import time
from dataclasses import replace
from typing import Any

import numpy as np
from playwright.sync_api import Browser, Page, expect

from daemon import mapshots
from daemon.snapshots import Snapshot
from tests.tools.fake_daemon import FakeDaemon
from tests.tools.fake_site import stations
from tests.tools.live_page import dashboard, free_port
from tests.tools.sight import near, orange_share, picture, until

STONE = (178, 170, 158)


def test_heading_depth_and_settings_stand_as_numbers(page: Page) -> None:
    expect(page.locator("#depth")).to_have_text("1.37m")
    expect(page.locator("#range")).to_have_text("8.0m")
    expect(page.locator("#gain")).to_have_text("45%")
    assert 37 <= int(page.locator("#heading").inner_text().removesuffix("°")) <= 47
    expect(page.locator("#site")).to_have_text("keyhole")
    assert page.title() == "keyhole · lacuna"


def test_the_sonar_shows_the_wall_where_it_is(page: Page) -> None:
    page.locator("#north-up").click()
    page.locator("#palette").select_option("grey")

    def wall_seen() -> bool:
        pixels = picture(page.locator("#polar")).astype(int).max(axis=-1)
        centre = len(pixels) / 2
        south = 2.0 / 8.0 * (centre - 22)  # the wall 2 m south of the vehicle
        column = pixels[:, round(centre) - 12 : round(centre) + 13].mean(axis=1)
        here = slice(round(centre + south) - 4, round(centre + south) + 5)
        return bool(column[here].max() > 120 > 3 * np.median(column[round(centre + 20) : round(centre + south) - 10]))

    until(wall_seen)


def test_the_pointer_tells_range_and_bearing(page: Page) -> None:
    box = page.locator("#polar").bounding_box()
    assert box is not None
    centre = box["width"] / 2
    page.locator("#north-up").click()
    page.locator("#polar").hover(position={"x": centre + (centre - 22) / 2, "y": centre})
    said = page.locator("#polar-readout").inner_text()
    assert said.startswith("4.0")
    assert "direction 090°" in said
    page.locator("#heading-up").click()
    page.locator("#polar").hover(position={"x": centre, "y": centre - (centre - 22) / 4})
    assert "bearing 000°" in page.locator("#polar-readout").inner_text()


def test_mesh_in_three_dimensions_and_measured_only(page: Page) -> None:
    page.keyboard.press("2")
    until(lambda: near(picture(page.locator("#mesh")), STONE, 30).mean() > 0.01, 40)
    assert orange_share(page) > 0.005
    page.locator("#measured-only").check()
    until(lambda: orange_share(page) < 0.0005)
    expect(page.locator(".modebar-btn")).to_have_count(3)  # none that would upload the mesh
    expect(page.locator("#legend-floor")).to_be_visible()
    page.keyboard.press("1")
    expect(page.locator("#plan")).to_be_visible()


def test_ports_have_a_lamp_and_a_word(page: Page) -> None:
    sonar, pilot = page.locator("[data-port=sonar]"), page.locator("[data-port=pilot]")
    expect(sonar).to_have_attribute("data-lamp", "green")
    expect(sonar).to_contain_text("39.8 pings/s")
    expect(pilot).to_have_attribute("data-lamp", "yellow")
    expect(pilot).to_contain_text("silent for 41 s")
    expect(page.locator("#lag")).to_have_text("map 0.4 s behind")
    expect(page.locator("#disk")).to_have_text("21.0 GiB free")


def test_a_feed_says_how_far_it_is_to_be_trusted(page: Page) -> None:
    compass, depth = page.locator("[data-port=compass]"), page.locator("[data-port=depth]")
    expect(compass).to_have_attribute("data-lamp", "yellow")
    expect(compass).to_contain_text("heading suspect")
    expect(compass).to_contain_text("heading: the compass warns: field low (M)")
    expect(compass).to_contain_text("so far 3 bad, 9 suspect")
    expect(compass).to_contain_text("refused: checksum 3")
    expect(compass).to_contain_text("field 31.26, undisturbed 44.8")
    expect(depth).to_have_attribute("data-lamp", "green")
    expect(depth.locator(".doubt")).to_have_count(0)


def test_what_the_walls_say_of_the_compass_is_one_line(page: Page, daemon: FakeDaemon) -> None:
    compass = page.locator("#compass")
    expect(compass).to_contain_text("Compass, by the walls at 3 stations: bias 0.0 ± ")
    expect(compass).not_to_contain_text("disturbed")
    told = mapshots.stations((0, time.time_ns()), stations())
    facts: dict[str, Any] = {
        "stations": 9, "bias_deg": -2.04, "bias_sd_deg": 0.61, "deviation_deg": 3.5, "deviation_sd_deg": 1.2,
        "curve": [], "disturbed": [3, 7],
    }  # fmt: skip
    daemon.say(replace(told, fields={**told.fields, "compass": facts}))
    expect(compass).to_have_text(
        "Compass, by the walls at 9 stations: bias −2.0 ± 0.6°, deviation 3.5 ± 1.2°, disturbed at 3, 7"
    )
    daemon.say(replace(told, fields={**told.fields, "compass": None}))
    expect(compass).to_be_hidden()
    daemon.say(told)
    expect(compass).to_be_visible()


def test_the_surface_is_shown_and_tared_only_when_confirmed(page: Page, daemon: FakeDaemon) -> None:
    expect(page.locator("#surface")).to_have_text("1009.4 mbar, tare")
    before = len(daemon.heard)
    page.once("dialog", lambda dialog: dialog.dismiss())
    page.get_by_role("button", name="Tare").click()
    page.once("dialog", lambda dialog: dialog.accept())
    page.get_by_role("button", name="Tare").click()
    expect(page.locator("#answer")).to_have_text("Tare: done.")
    assert [(each.do, each.fields) for each in daemon.heard[before:]] == [("tare", {"port": "depth"})]


def test_step_sector_and_pause_reach_the_head(page: Page, daemon: FakeDaemon) -> None:
    form = page.locator("#form-sonar")
    expect(form.locator("[name=step_deg]")).to_have_attribute("placeholder", "1.8")
    expect(form.locator("[name=left_deg]")).to_have_attribute("placeholder", "full")
    form.locator("[name=left_deg]").fill("-45")
    page.get_by_role("button", name="Set").click()
    expect(page.locator("#answer")).to_contain_text("A sector has a left and a right limit")
    form.locator("[name=right_deg]").fill("60.5")
    form.locator("[name=step_deg]").fill("0.9")
    page.get_by_role("button", name="Set").click()
    expect(page.locator("#answer")).to_have_text("Sonar: done.")
    assert daemon.heard[-1].fields == {"step_deg": 0.9, "sector_deg": [-45, 60.5]}
    page.get_by_role("button", name="Full circle").click()
    expect(page.locator("#answer")).to_have_text("Full circle: done.")
    assert daemon.heard[-1].fields == {"sector_deg": None}
    page.get_by_role("button", name="Pause").click()
    expect(page.locator("#answer")).to_have_text("Pause: done.")
    assert daemon.heard[-1].fields == {"stop": True}


def test_a_lost_port_turns_red_and_events_are_told(page: Page, daemon: FakeDaemon) -> None:
    daemon.say(Snapshot("event", 1, time.time_ns(), {"kind": "port_lost", "fields": {"port": "sonar"}}))
    daemon.sonar_state = "lost"
    expect(page.locator("[data-port=sonar]")).to_have_attribute("data-lamp", "red")
    expect(page.locator("[data-port=sonar]")).to_contain_text("lost")
    daemon.sonar_state = "open"
    expect(page.locator("#events li").first).to_contain_text("port lost, port sonar")
    daemon.say(Snapshot("event", 2, time.time_ns(), {"kind": "note", "fields": {"text": "<b>amphora</b>"}}))
    expect(page.locator("#events li").first).to_contain_text("note, <b>amphora</b>")
    assert page.locator("#events b").count() == 0


def test_commands_reach_the_daemon_and_its_refusal_is_shown(page: Page, daemon: FakeDaemon) -> None:
    page.get_by_label("Text of a mark or a note").fill("amphora")
    page.get_by_role("button", name="Mark").click()
    expect(page.locator("#answer")).to_have_text("Mark: done.")
    assert (daemon.heard[-1].do, daemon.heard[-1].fields) == ("mark", {"text": "amphora"})
    page.get_by_label("Moved east").fill("1.5")
    page.locator("#form-hint [name=dy_m]").fill("-0.5")
    page.get_by_role("button", name="Hint").click()
    expect(page.locator("#answer")).to_have_text("Hint: done.")
    assert daemon.heard[-1].fields["dy_m"] == -0.5
    page.locator("#form-drop select").select_option("4")
    page.get_by_role("button", name="Drop").click()
    expect(page.locator("#answer")).to_have_text("Drop station 4: done.")
    assert daemon.heard[-1].fields == {"station": 4}
    page.locator("#form-sonar [name=range_m]").fill("200")
    page.get_by_role("button", name="Set").click()
    expect(page.locator("#answer")).to_have_text("Sonar: the head reaches 100 m. Ask for less.")
    expect(page.locator("#answer")).to_have_class("answer bad")


def test_a_silent_daemon_is_said_and_forgiven(page: Page, daemon: FakeDaemon) -> None:
    daemon.silent.set()
    expect(page.locator("#banner")).to_contain_text("No data for", timeout=10_000)
    expect(page.locator("#link")).to_have_attribute("data-lamp", "yellow")
    daemon.silent.clear()
    expect(page.locator("#banner")).to_be_hidden(timeout=10_000)
    expect(page.locator("#link")).to_have_attribute("data-lamp", "green")


def test_everything_is_reached_by_keyboard_and_has_a_name(page: Page) -> None:
    names: list[str] = []
    for _ in range(40):
        page.keyboard.press("Tab")
        names.append(
            page.evaluate(
                "document.activeElement.id || document.activeElement.name || document.activeElement.innerText"
            )
        )
    for wanted in (
        "heading-up",
        "north-up",
        "polar",
        "palette",
        "floor",
        "tab-plan",
        "fit",
        "plan",
        "text",
        "Mark",
        "range_m",
        "save",
    ):
        assert wanted in names, names
    unnamed = """[...document.querySelectorAll('button,input,select,canvas')]
        .filter(e => !(e.labels?.length || e.ariaLabel || e.innerText)).map(e => e.outerHTML)"""
    assert page.evaluate(unnamed) == []


def test_nothing_is_cut_off_on_a_small_laptop(page: Page) -> None:
    assert page.evaluate("[document.documentElement.scrollWidth, document.documentElement.scrollHeight]") == [1366, 650]
    outside = """[...document.querySelectorAll('main button, main input, dd')]
        .filter(e => e.offsetParent && e.getBoundingClientRect().right > 1366)"""
    assert page.evaluate(f"{outside}.length") == 0


def test_a_new_session_clears_the_page_and_a_lost_server_is_said(chromium: Browser) -> None:
    port = free_port()
    first = FakeDaemon(port, "session-one")
    page = chromium.new_page(viewport={"width": 1366, "height": 650})
    try:
        with dashboard(port) as served:
            page.goto(served.url)
            expect(page.locator("#session")).to_have_text("session session-one")
            first.say(Snapshot("event", 1, time.time_ns(), {"kind": "mark", "fields": {}}))
            expect(page.locator("#events li")).to_have_count(1)
            first.close()
            first = FakeDaemon(port, "again-two")
            expect(page.locator("#session")).to_have_text("session again-two", timeout=15_000)
            expect(page.locator("#events li")).to_have_count(0)
            expect(page.locator("#link-word")).to_have_text("live")
        expect(page.locator("#banner")).to_contain_text("lost", timeout=10_000)
        expect(page.locator("#link")).to_have_attribute("data-lamp", "red")
    finally:
        page.close()
        first.close()
