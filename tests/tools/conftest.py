"""A made-up daemon, the dashboard that serves its page, and that page in a real Chromium."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from typing import TYPE_CHECKING

import pytest

from tests.tools.fake_daemon import FakeDaemon
from tests.tools.live_page import Dashboard, dashboard, free_port

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page, Request

FLAGS = [
    "--headless=new", "--no-sandbox", "--disable-gpu", "--disable-background-networking", "--no-first-run",
    "--disable-component-update", "--disable-sync", "--disable-quic",
]  # fmt: skip


@pytest.fixture(scope="module")
def daemon() -> Iterator[FakeDaemon]:
    """Serve the made-up site on free ports, one for the tests of a file."""
    served = FakeDaemon(free_port())
    yield served
    served.close()


@pytest.fixture(scope="module")
def served(daemon: FakeDaemon) -> Iterator[Dashboard]:
    """Start the dashboard of the made-up daemon."""
    with dashboard(daemon.port) as running:
        yield running


@pytest.fixture(scope="module")
def chromium() -> Iterator[Browser]:
    """Start the system's Chromium; skip where there is none."""
    from playwright.sync_api import sync_playwright

    path = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
    if path is None:
        pytest.skip("no Chromium on this machine: apt-get install chromium")
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=FLAGS)
        yield browser
        browser.close()


@pytest.fixture
def page(chromium: Browser, served: Dashboard) -> Iterator[Page]:
    """Open the page and watch it: an error in it, or a request to anywhere else, fails the test."""
    from playwright.sync_api import expect

    wrong: list[str] = []
    page = chromium.new_page(viewport={"width": 1366, "height": 650})
    page.on("pageerror", lambda error: wrong.append(f"error: {error}"))
    page.on("console", lambda said: wrong.append(f"console: {said.text}") if said.type == "error" else None)

    def watch(request: Request) -> None:
        if not request.url.startswith((served.url, "data:", "blob:")):
            wrong.append(f"request to {request.url}")

    page.on("request", watch)
    page.goto(served.url)
    expect(page.locator("#link-word")).to_have_text("live")
    expect(page.locator("#heading")).not_to_have_text("–")
    yield page
    page.close()
    assert wrong == []
