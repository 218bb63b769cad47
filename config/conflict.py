"""A mistake of meaning: what each key alone allows but the whole does not."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Conflict:
    """Key with dots, what stands there, what would be right, what to do."""

    key: str
    got: str
    expected: str
    hint: str = ""
