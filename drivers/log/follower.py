"""Following a session while it is written: the records of ``read_log``, as soon as their chunk is complete."""

from __future__ import annotations

from pathlib import Path
from typing import BinaryIO

from config.errors import LogError
from drivers.log.header import check_format
from drivers.log.names import part_path, segment_path, segments
from drivers.log.reader import Sequences, reading
from drivers.log.scanner import Block, Damage, Scanner
from drivers.records import Record


class Follower:
    """Tails the growing segments of one session from its beginning.

    The bytes go through the reader's own scanner, so what comes out is what ``read_log`` gives of the same files.
    An open file stays the same under a new name, so the change from ``.part`` to the final name loses nothing.
    """

    def __init__(self, folder: Path, session: str) -> None:
        self._folder = folder
        self._session = session
        self._number = 0
        self._file: BinaryIO | None = None
        self._path = folder
        self._is_closed = False
        self.damage = Damage()
        """What could not be read so far."""
        self._scanner = Scanner(self.damage)
        self._sequences = Sequences(self.damage)

    def poll(self) -> list[Record]:
        """Return the next records, those of about 256 KiB of log at most; an empty list means: no more for now.

        Raises DataError where a newer version writes the log, LogError where the disk fails.
        """
        while not self._is_closed and (self._file is not None or self._open_next()):
            # Asked before reading: bytes written before the name changed are then surely read.
            is_final = self._is_final()
            data = self._read()
            found = self._scanner.push(data) if data else self._scanner.finish() if is_final else iter(())
            records = [record for block in found for record in self._take(block)]
            if not data and is_final:
                self._release()
            if records:
                return records
            if not data and not is_final:
                return []
        return []

    def close(self) -> None:
        """Let go of the open segment; ``poll`` gives nothing more."""
        self._is_closed = True
        self._release()

    def __enter__(self) -> Follower:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _release(self) -> None:
        if self._file is not None:
            self._file.close()
        self._file = None

    def _read(self) -> bytes:
        return reading(self._file, self._path)() if self._file is not None else b""

    def _take(self, block: Block) -> list[Record]:
        if isinstance(block, dict):
            check_format(block, self._path.name)
            self._sequences.begin(block)
            return []
        self._sequences.take(block)
        return [entry.record for entry in block]

    def _is_final(self) -> bool:
        # A segment that was left as .part, by a crash or a full disk, ends where the next begins.
        return segment_path(self._folder, self._session, self._number).exists() or bool(self._later())

    def _later(self) -> list[int]:
        return [number for number in segments(self._folder, self._session) if number > self._number]

    def _open_next(self) -> bool:
        later = self._later()
        # A listing may miss a file that is renamed meanwhile, so the next number is asked for by name, and only when
        # it is missing while a later one stands there (then nobody renames it any more), it is passed over.
        for number in dict.fromkeys([self._number + 1, *later]):
            path = segment_path(self._folder, self._session, number)
            for name in (path, part_path(path), path):
                try:
                    self._file = name.open("rb", buffering=0)
                except FileNotFoundError:
                    continue
                except OSError as error:
                    raise LogError(f"cannot open {name}: {error.strerror}; check its permissions") from error
                self._number, self._path = number, path
                self._scanner = Scanner(self.damage)
                return True
        return False
