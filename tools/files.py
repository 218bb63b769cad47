"""Whole files or none: written under a temporary name, made safe on the disk, then renamed."""

from __future__ import annotations

import contextlib
import os
from pathlib import Path

from config.errors import InputError, LogError


def make_folder(folder: Path) -> None:
    """Make ``folder`` and its parents; raises InputError where that cannot be."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"cannot make folder {folder}: {error.strerror}; choose another with -o") from error


def replace_file(path: Path, data: bytes) -> None:
    """Write ``data`` to ``path``, replacing what stands there only once all bytes are on the disk; raises LogError."""
    part = path.with_name(path.name + ".part")
    try:
        with part.open("wb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        part.replace(path)
    except OSError as error:
        _forget(part)
        raise LogError(f"cannot write {path}: {error.strerror}; free some space or choose another folder") from error


def _forget(part: Path) -> None:
    with contextlib.suppress(OSError):
        part.unlink()


def read_bytes(path: Path) -> bytes:
    """All bytes of ``path``; raises InputError where it cannot be read."""
    try:
        return path.read_bytes()
    except OSError as error:
        raise InputError(f"cannot read {path}: {error.strerror}; check the name") from error
