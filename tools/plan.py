"""The drawn plan: what was measured, what was filled in and how surely, what was never seen, and where from."""

from __future__ import annotations

import io
import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from PIL import Image, PngImagePlugin

from fill.values import Filled
from mapping.values import Outline, Station
from tools import plan_canvas as canvas
from tools.plan_canvas import Frame, frame_of, raster
from tools.plan_marks import STATION, Pen, draw_certainties, draw_ellipses, draw_north, draw_scale_bar, draw_stations
from tools.plan_pieces import PIECE, draw_dashes, draw_pieces, draw_walls, pieces_of, room_for
from tools.provenance import Provenance

_PANEL: Final = 270  # width of the legend, px
_TITLE: Final = 62
_EDGE: Final = 12
_LOWEST: Final = 470  # the legend needs this height, and more where it names many stations
_NAMES_AT: Final = 350
_NAMES_STEP: Final = 18


@dataclass(frozen=True, slots=True)
class Plan:
    """A drawn plan: PNG bytes, and the text of its world file (ESRI: six lines, metres per pixel and upper left)."""

    png: bytes
    world: str


@dataclass(frozen=True, slots=True)
class _Marked:
    """What the legend tells of stations: those outside floating pieces, whether there are such, and who is named."""

    alone: Sequence[Station]
    has_pieces: bool
    names: Sequence[str]


def draw_plan(
    filled: Filled, stations: Sequence[Station], origin: Provenance, outlines: Sequence[Outline] = ()
) -> Plan:
    """Draw the plan, north up, with title, legend, scale bar, stations and what floating pieces saw."""
    pieces = pieces_of(stations)
    alone = [each for each in stations if each.piece not in pieces or each.status == "dropped"]
    frame = frame_of(filled, np.concatenate([_places(alone), room_for(pieces, outlines, filled.grid.cell_m)]))
    names = _names(alone, pieces)
    lowest = max(frame.height, _LOWEST, _NAMES_AT + _NAMES_STEP * len(names))
    width, height = frame.width + _PANEL + 3 * _EDGE, lowest + _TITLE + _EDGE
    image = Image.new("RGB", (width * frame.fine, height * frame.fine), canvas.PAPER)
    picture = Image.fromarray(raster(filled, frame))
    draw_ellipses(Pen(picture, frame.fine, 0, 0), frame, alone)
    image.paste(picture, (_EDGE * frame.fine, _TITLE * frame.fine))
    over = Pen(image, frame.fine, _EDGE, _TITLE)
    draw_certainties(over, frame, filled)
    draw_walls(over, frame, outlines)
    draw_pieces(over, frame, pieces)
    draw_stations(over, frame, alone)
    _title(Pen(image, frame.fine, _EDGE, 0), origin, width - 2 * _EDGE)
    _legend(Pen(image, frame.fine, frame.width + 2 * _EDGE, _TITLE), frame, filled, _Marked(alone, bool(pieces), names))
    final = image.resize((width, height), Image.Resampling.BOX) if frame.fine > 1 else image
    return Plan(_png(final, origin), _world(frame))


def _places(alone: Sequence[Station]) -> NDArray[np.float64]:
    shown = [each.pose for each in alone if each.status in ("placed", "doubtful")]
    return np.array([(pose.x_m, pose.y_m) for pose in shown]).reshape(-1, 2)


def _title(pen: Pen, origin: Provenance, room: float) -> None:
    pen.text(0, 8, f"Plan of {origin.site}", 22)
    line = origin.line
    while pen.width(line, 12) > room:
        line = line[:-4] + "…"
    pen.text(0, 38, line, 12)


def _legend(pen: Pen, frame: Frame, filled: Filled, marked: _Marked) -> None:
    draw_north(pen, _PANEL - 24, 52)
    draw_scale_bar(pen, frame, 8, 26, _PANEL - 90)
    y = 84.0
    for words, kind in (
        ("wall, measured", "wall"),
        ("open water, seen", "free"),
        ("never seen", "unknown"),
    ):
        _swatch(pen, 0, y, kind)
        pen.text(44, y + 9, words, 14, anchor="lm")
        y += 27
    pen.text(0, y + 4, "wall, filled in; certainty:", 14)
    y = _ramp(pen, y + 26)
    holes, ends = len(filled.holes), len(filled.open_ends_m)
    pen.text(
        0, y, f"{holes} hole{'' if holes == 1 else 's'} filled, {ends} end{'' if ends == 1 else 's'} left open", 13
    )
    _mark_legend(pen, y + 26, marked)


def _swatch(pen: Pen, x: float, y: float, kind: str) -> None:
    box = [(x, y), (x + 34, y), (x + 34, y + 18), (x, y + 18)]
    colours = {"wall": canvas.WALL, "free": canvas.FREE_WATER, "unknown": canvas.NEVER_SEEN}
    pen.polygon(box, colours[kind])
    if kind == "unknown":
        for start in range(0, 34, 9):
            pen.line([(x + start, y + 18), (x + min(start + 18, 34), y + max(0, start - 16))], canvas.NEVER_SEEN_HATCH)
    pen.line([*box, box[0]], canvas.INK, 1)


def _ramp(pen: Pen, y: float) -> float:
    """Draw the certainty scale with its stripes; return where the next line goes."""
    shares = np.linspace(0.0, 1.0, 5).astype(np.float32)
    for place, (share, colour) in enumerate(zip(shares, canvas.fill_colours(shares), strict=True)):
        left = place * 50.0
        box = [(left, y), (left + 50, y), (left + 50, y + 18), (left, y + 18)]
        red, green, blue = (int(channel) for channel in colour)
        pen.polygon(box, (red, green, blue))
        for start in range(0, 50, 9):
            end = min(start + 18, 50)
            pen.line([(left + start, y), (left + end, y + end - start)], canvas.FILL_STRIPE, 2)
        pen.text(left + 25, y + 22, f"{share:.0%}", 12, anchor="ma")
    return y + 46


def _mark_legend(pen: Pen, y: float, marked: _Marked) -> None:
    if marked.alone:
        pen.disc(10, y + 8, 4.5, STATION, STATION)
        pen.line([(10, y + 8), (10, y - 6)], STATION, 2.2)
        pen.text(28, y + 8, "station, heading, 95 % ellipse", 13, anchor="lm")
        y += 24
    if any(each.status == "doubtful" for each in marked.alone):
        pen.disc(10, y + 8, 4.5, canvas.PAPER, STATION)
        pen.text(28, y + 8, "doubtful: not in the evidence", 13, anchor="lm")
        y += 24
    if marked.has_pieces:
        draw_dashes(pen, [(0, y + 1), (20, y + 1), (20, y + 15), (0, y + 15), (0, y + 1)], PIECE, 1.6)
        pen.text(28, y + 8, "floating piece, dots its walls: a guess", 13, anchor="lm")
        y += 24
    for line in marked.names:
        pen.text(0, y, line, 13)
        y += _NAMES_STEP


def _names(alone: Sequence[Station], pieces: dict[int, list[Station]]) -> list[str]:
    """Name, in lines, the stations without a mark on the plan and those of each floating piece."""
    said = [(f"piece {number}, not tied yet", members) for number, members in pieces.items()]
    said += [(status, [each for each in alone if each.status == status]) for status in ("unplaced", "dropped")]
    lines = []
    for what, members in said:
        numbers = ", ".join(str(each.scan.index) for each in members)
        lines += textwrap.wrap(f"{what}: {numbers}", 38) if numbers else []
    return lines


def _png(image: Image.Image, origin: Provenance) -> bytes:
    notes = PngImagePlugin.PngInfo()
    notes.add_text("Title", f"Plan of {origin.site}")
    notes.add_text("Software", origin.line.encode("latin-1", "replace").decode("latin-1"))
    out = io.BytesIO()
    image.save(out, "PNG", pnginfo=notes)
    return out.getvalue()


def _world(frame: Frame) -> str:
    """Lines of the world file: pixel size and the centre of the picture's upper left pixel in map metres."""
    pixel_m = frame.cell_m / frame.px
    west = frame.x0_m + frame.col0 * frame.cell_m - (_EDGE - 0.5) * pixel_m
    north = frame.y0_m + (frame.row0 + frame.rows) * frame.cell_m + (_TITLE - 0.5) * pixel_m
    return "".join(f"{value:.9f}\n" for value in (pixel_m, 0.0, 0.0, -pixel_m, west, north))
