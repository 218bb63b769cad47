"""How the tests of the page look at it: pixels of a part of it, and their colours."""

from __future__ import annotations

import io
import time
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from playwright.sync_api import Locator, Page


def picture(of: Locator) -> NDArray[np.uint8]:
    return np.asarray(Image.open(io.BytesIO(of.screenshot())).convert("RGB"))


def near(pixels: NDArray[np.uint8], colour: tuple[int, int, int], within: int = 12) -> NDArray[np.bool_]:
    return np.asarray((np.abs(pixels.astype(int) - colour) <= within).all(axis=-1))


def until(seen: Callable[[], bool], seconds: float = 20) -> None:
    end = time.monotonic() + seconds
    while not seen():
        assert time.monotonic() < end, "it is not to be seen"
        time.sleep(0.1)


def on_plan(page: Page, x_m: float, y_m: float) -> tuple[int, int]:
    """Pixel of a place, worked out from the plan's own words under the pointer at two corners."""
    box = page.locator("#plan").bounding_box()
    assert box is not None

    def place(px: float, py: float) -> tuple[float, float]:
        page.mouse.move(box["x"] + px, box["y"] + py)
        page.wait_for_timeout(120)
        east, north = page.locator("#plan-readout").inner_text().split("·")[:2]
        return float(east.split()[0]), float(north.split()[0])

    (x0, y0), (x1, y1) = place(10, 100), place(510, 400)
    return round(10 + 500 * (x_m - x0) / (x1 - x0)), round(100 + 300 * (y_m - y0) / (y1 - y0))


def orange_share(page: Page) -> float:
    return float(orange(picture(page.locator("#mesh"))).mean())


def orange(pixels: NDArray[np.uint8]) -> NDArray[np.bool_]:
    red, blue = pixels[..., 0].astype(int), pixels[..., 2].astype(int)
    return np.asarray(red > blue + 70)
