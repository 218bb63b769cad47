"""Marks on the plan: stations, certainties, scale bar, north arrow, legend."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from fill.values import Filled
from mapping.values import Station
from tools import plan_canvas as canvas
from tools.plan_canvas import Frame

STATION: Final = (0, 90, 160)
_ELLIPSE_95: Final = math.sqrt(5.991)  # chi-square, two degrees of freedom
_LABELS_AT_MOST: Final = 40
Font = ImageFont.FreeTypeFont | ImageFont.ImageFont
Box = tuple[float, float, float, float]


class Pen:
    """Draws in final pixels on an image that is ``fine`` times larger."""

    def __init__(self, image: Image.Image, fine: int, left: float, top: float) -> None:
        self._draw = ImageDraw.Draw(image)
        self._fine = fine
        self._left = left
        self._top = top

    def font(self, size: float) -> Font:
        """Return the built-in font at ``size`` final pixels."""
        return ImageFont.load_default(size * self._fine)

    def line(self, points: Sequence[tuple[float, float]], colour: canvas.Colour, width: float = 1.5) -> None:
        """Draw a polyline."""
        self._draw.line(self._scaled(points), fill=colour, width=max(1, round(width * self._fine)))

    def polygon(self, points: Sequence[tuple[float, float]], colour: canvas.Colour) -> None:
        """Fill a polygon."""
        self._draw.polygon(self._scaled(points), fill=colour)

    def disc(self, x: float, y: float, radius: float, colour: canvas.Colour | None, edge: canvas.Colour) -> None:
        """Draw a circle, filled or hollow."""
        corners = self._scaled([(x - radius, y - radius), (x + radius, y + radius)])
        self._draw.ellipse([corners[0], corners[1]], fill=colour, outline=edge, width=round(1.5 * self._fine))

    def text(self, x: float, y: float, words: str, size: float, anchor: str = "la", halo: bool = False) -> None:
        """Write one line."""
        at = self._scaled([(x, y)])[0]
        edge = round(2 * self._fine) if halo else 0
        self._draw.text(
            at, words, fill=canvas.INK, font=self.font(size), anchor=anchor, stroke_width=edge, stroke_fill=canvas.PAPER
        )

    def width(self, words: str, size: float) -> float:
        """Width of a line in final pixels."""
        return self._draw.textlength(words, font=self.font(size)) / self._fine

    def _scaled(self, points: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
        return [((x + self._left) * self._fine, (y + self._top) * self._fine) for x, y in points]


def draw_ellipses(pen: Pen, frame: Frame, stations: Sequence[Station]) -> None:
    """Draw the 95 % ellipse of every station that has a place."""
    for station in stations:
        if station.status in ("placed", "doubtful"):
            pen.line(_ellipse(station, frame), STATION, 1.2)


def draw_stations(pen: Pen, frame: Frame, stations: Sequence[Station]) -> None:
    """Draw numbered stations with heading tick; hollow where the place is doubtful."""
    for station in stations:
        if station.status not in ("placed", "doubtful"):
            continue
        x, y = frame.place(station.pose.x_m, station.pose.y_m)
        label = str(station.scan.index) + ("?" if station.status == "doubtful" else "")
        draw_station(pen, (x, y), station, label, (STATION if station.status == "placed" else canvas.PAPER, STATION))


def draw_station(
    pen: Pen, at: tuple[float, float], station: Station, label: str, colours: tuple[canvas.Colour, canvas.Colour]
) -> None:
    """Draw a disc (``colours`` of it and of its edge), the heading as a tick, and the label on the side without it."""
    x, y = at
    east, south = math.sin(station.pose.heading_rad), -math.cos(station.pose.heading_rad)
    pen.line([(x, y), (x + 15 * east, y + 15 * south)], colours[1], 2.2)
    pen.disc(x, y, 4.5, *colours)
    pen.text(x - 16 * east, y - 16 * south, label, 14, anchor="mm", halo=True)


def _ellipse(station: Station, frame: Frame) -> list[tuple[float, float]]:
    values, axes = np.linalg.eigh(station.covariance[:2, :2])
    sds = np.sqrt(np.maximum(values, 0.0)) * _ELLIPSE_95
    turn = np.linspace(0.0, 2.0 * math.pi, 49)
    ring = (axes * sds) @ np.stack([np.cos(turn), np.sin(turn)])
    return [frame.place(station.pose.x_m + dx, station.pose.y_m + dy) for dx, dy in ring.T]


def draw_certainties(pen: Pen, frame: Frame, filled: Filled) -> None:
    """Write each hole's certainty in per cent beside it, largest gaps first, where there is room."""
    taken: list[Box] = []
    for hole in sorted(filled.holes, key=lambda each: (-each.gap_m, each.index))[:_LABELS_AT_MOST]:
        row, col = hole.cells[len(hole.cells) // 2]
        x, y = frame.place(frame.x0_m + (col + 0.5) * frame.cell_m, frame.y0_m + (row + 0.5) * frame.cell_m)
        words = f"{hole.hole_certainty:.0%}"
        box = (x + 5, y - 6, x + 9 + pen.width(words, 11), y + 7)
        if box[2] < frame.width and not any(_overlap(box, other) for other in taken):
            taken.append(box)
            pen.text(box[0] + 2, y, words, 11, anchor="lm", halo=True)


def _overlap(a: Box, b: Box) -> bool:
    return a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3]


def draw_scale_bar(pen: Pen, frame: Frame, x: float, y: float, room_px: float) -> None:
    """Draw a bar of a round length in metres, in four parts."""
    length_m = round_length_m(room_px * frame.cell_m / frame.px)
    width = length_m / frame.cell_m * frame.px
    for part in range(4):
        colour = canvas.INK if part % 2 == 0 else canvas.PAPER
        left, right = x + part * width / 4, x + (part + 1) * width / 4
        pen.polygon([(left, y), (right, y), (right, y + 6), (left, y + 6)], colour)
    pen.line([(x, y), (x + width, y), (x + width, y + 6), (x, y + 6), (x, y)], canvas.INK, 1)
    pen.text(x, y + 10, "0", 12, anchor="ma")
    pen.text(x + width, y + 10, f"{length_m:g} m", 12, anchor="ma")


def round_length_m(room_m: float) -> float:
    """Return the largest of 1, 2, 5 times a power of ten that is not longer than ``room_m``."""
    power = 10.0 ** math.floor(math.log10(room_m))
    return max(step * power for step in (1.0, 2.0, 5.0) if step * power <= room_m)


def draw_north(pen: Pen, x: float, y: float) -> None:
    """Draw an arrow to the map's north, its tip 34 pixels above ``y``."""
    pen.polygon([(x, y - 34), (x + 8, y), (x, y - 8)], canvas.INK)
    pen.polygon([(x, y - 34), (x - 8, y), (x, y - 8)], canvas.FREE_WATER)
    pen.line([(x, y - 34), (x + 8, y), (x, y - 8), (x - 8, y), (x, y - 34)], canvas.INK, 1)
    pen.text(x, y - 37, "N", 14, anchor="mb")
