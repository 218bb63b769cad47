"""The formats that can be imported, and which of them a file has."""

from __future__ import annotations

import zlib
from pathlib import Path
from typing import Final

from config.errors import DataError, InputError
from drivers.log.segment import MAGIC
from tools.importers import hub_csv, json_lines, raw_serial, v4log
from tools.importers.capture import Format, opened

FORMATS: Final[dict[str, Format]] = {
    "v4log": v4log.FORMAT,
    "hub-csv": hub_csv.FORMAT,
    "jsonl": json_lines.FORMAT,
    "serial": raw_serial.FORMAT,
}
"""By the name that ``--format`` takes; the first whose ``sniff`` says yes is taken, and ``serial`` takes everything."""

_SNIFFED: Final = 4096


def format_of(path: Path, told: str | None = None) -> str:
    """Return the name of the format of ``path``: the one ``told``, or found from its first bytes.

    Raises InputError for a file that cannot be read, DataError for one that is empty or a log of lacuna already.
    """
    if not path.is_file():
        what = "is not a file" if path.exists() else "does not exist"
        raise InputError(f"{path} {what}; name a recording to import")
    try:
        with opened(path) as file:
            head = file.read(_SNIFFED)
    except (EOFError, zlib.error, OSError) as error:
        raise DataError(f"{path} cannot be unpacked ({error}); it is a damaged gzip file") from error
    if not head:
        raise DataError(f"{path} is empty; there is nothing to import")
    if head.startswith(MAGIC):
        raise DataError(f"{path} is a log (MCAP) already; use it as it is, or 'lacuna salvage' if it is broken")
    return told or next(name for name, each in FORMATS.items() if each.sniff(head))
