"""The table of methods, one line each."""

from __future__ import annotations

from typing import Final

Row = dict[str, str | int | float]

_COLUMNS: Final = (
    ("P", "P"),
    ("R", "R"),
    ("F1", "F1"),
    ("F1_low", "from"),
    ("F1_high", "to"),
    ("holes_right", "holes"),
    ("holes_right_low", "from"),
    ("holes_right_high", "to"),
    ("holes_right_3-5", "3-5"),
    ("holes_right_6-10", "6-10"),
    ("holes_right_11-20", "11-20"),
    ("holes_right_21-40", "21-40"),
    ("stretch_right", "wall"),
    ("shadow_right", "shade"),
    ("walled_unseen", "unseen"),
    ("walled_seen", "seen"),
    ("brier_skill", "Brier"),
    ("ece", "ECE"),
    ("far_per_lost", "far"),
    ("over_water_per_lost", "water"),
)
_NAME: Final = 34
_WIDTH: Final = 6

LEGEND: Final = (
    "cells right within one cell of true wall: P, R, F1 (95 % from-to over losses); holes closed right: all (from-to), "
    "by gap in cells, in stretches of wall, in shadows; true openings walled up: water unseen, seen; Brier skill over "
    "the base rate; calibration error; cells filled far from any loss, and over water seen, per cell lost"
)


def line(row: Row) -> str:
    """Return a line of the table; the row of facts comes with the legend and the head of the table."""
    if "size_of" in row:
        return "paper's measure: " + ", ".join(f"{key} {value}" for key, value in row.items())
    if "gap" in row:
        return "holes: " + ", ".join(f"{key} {value}" for key, value in row.items())
    if "model" in row:
        return "prior: " + ", ".join(f"{key} {value}" for key, value in row.items())
    if "method" not in row:
        facts = [f"holes: {key} {value}" for key, value in row.items()]
        return "\n".join([*facts, LEGEND, _cells("", [name for _, name in _COLUMNS])])
    return _cells(str(row["method"]), [_figure(row.get(key)) for key, _ in _COLUMNS])


def _cells(name: str, cells: list[str]) -> str:
    return f"{name:{_NAME}}" + " ".join(f"{cell:>{_WIDTH}}" for cell in cells)


def _figure(value: str | int | float | None) -> str:
    return "-" if value is None else f"{float(value):.2f}"
