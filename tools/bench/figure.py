"""A measured figure beside what was promised of it."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Figure:
    """``value`` as measured; ``promise`` in words, empty where none is made; ``holds`` whether it was kept."""

    name: str
    value: float
    unit: str
    promise: str = ""
    holds: bool = True

    def row(self) -> dict[str, str | int | float]:
        """Return the figure as a row to print."""
        verdict = {} if not self.promise else {"promise": self.promise, "holds": "yes" if self.holds else "NO"}
        return {"figure": self.name, "value": round(self.value, 3), "unit": self.unit, **verdict}


def at_most(name: str, value: float, limit: float, unit: str) -> Figure:
    """Return a figure that may not exceed ``limit``."""
    return Figure(name, value, unit, f"at most {limit:g}", value <= limit)


def at_least(name: str, value: float, limit: float, unit: str) -> Figure:
    """Return a figure that may not fall below ``limit``."""
    return Figure(name, value, unit, f"at least {limit:g}", value >= limit)
