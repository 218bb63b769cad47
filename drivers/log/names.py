"""Names of log files: ``<session>-<number>.mcap``, with ``.part`` behind it until the file is whole."""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path
from typing import Final

from config.errors import DataError, InputError
from drivers.log.segment import PART

_NAME: Final = re.compile(r"(?P<session>.+)-(?P<number>\d{4,})\.mcap(?:\.part)?")
_ENDINGS: Final = (".mcap", ".mcap" + PART)


def segment_path(folder: Path, session: str, number: int) -> Path:
    """Return the final path of a segment."""
    return folder / f"{session}-{number:04d}.mcap"


def part_path(path: Path) -> Path:
    """Return the path that a log has while it is written."""
    return path.with_name(path.name + PART)


def segments(folder: Path, session: str) -> dict[int, Path]:
    """Return the segments of ``session`` by number, in order; a whole file goes before a ``.part`` of its number."""
    found: dict[int, Path] = {}
    for path in _logs(folder):
        match = _NAME.fullmatch(path.name)
        if match is not None and match["session"] == session:
            found.setdefault(int(match["number"]), path)
    return dict(sorted(found.items()))


def log_files(paths: Iterable[Path]) -> list[Path]:
    """Return the log files that ``paths`` name: files as given, of a folder its segments by session and number.

    Raises InputError for what is not there, DataError for a folder without logs.
    """
    files: list[Path] = []
    for path in paths:
        if path.is_dir():
            inside = _in_folder(path)
            if not inside:
                raise DataError(f"{path} holds no logs (*.mcap); give the folder that recording writes to")
            files += inside
        elif path.is_file():
            files.append(path)
        else:
            what = "is not a file" if path.exists() else "does not exist"
            raise InputError(f"{path} {what}; give a log (*.mcap) or a folder of logs")
    if not files:
        raise InputError("no log was named; give a log (*.mcap) or a folder of logs")
    return files


def _in_folder(folder: Path) -> list[Path]:
    whole = {path.name for path in _logs(folder)}
    kept = [path for path in _logs(folder) if path.suffix != PART or path.name.removesuffix(PART) not in whole]
    return sorted(kept, key=_order)


def _order(path: Path) -> tuple[str, int, str]:
    match = _NAME.fullmatch(path.name)
    return (match["session"], int(match["number"]), "") if match else (path.name, 0, path.name)


def _logs(folder: Path) -> list[Path]:
    try:
        return sorted(path for path in folder.iterdir() if path.name.endswith(_ENDINGS))
    except FileNotFoundError:
        return []
    except OSError as error:
        raise InputError(f"cannot list {folder}: {error.strerror}; check its permissions") from error


def session_of(path: Path) -> str:
    """Return the session that the name of ``path`` tells."""
    match = _NAME.fullmatch(path.name)
    return match["session"] if match else path.name.removesuffix(PART).removesuffix(".mcap")
