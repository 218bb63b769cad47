"""A fault of the program itself, told to the operator in one line: what failed, where, and what to do now."""

from __future__ import annotations

import traceback
from pathlib import Path

from config.errors import LacunaError


def fault(who: str, error: Exception) -> LacunaError:
    """Return an unforeseen ``error`` of the process ``who`` as a line for people that a programmer can begin with."""
    last = traceback.extract_tb(error.__traceback__)[-1:]
    where = f" ({Path(last[0].filename).name}:{last[0].lineno})" if last else ""
    what = " ".join(str(error).split()) or "no more is known"
    return LacunaError(f"a fault in the {who}: {type(error).__name__}: {what}{where}; please report it with the log")
