"""What a decoder has seen on its line, for health."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field


@dataclass(frozen=True, slots=True)
class Counters:
    """Counts since the decoder was made: whole frames by kind, bytes outside frames, refused frames by reason."""

    frames: Mapping[str, int] = field(default_factory=dict)
    skipped_bytes: int = 0
    bad: Mapping[str, int] = field(default_factory=dict)
