"""Writing a session's log as a row of segments."""

from __future__ import annotations

import errno
from pathlib import Path
from typing import Final

from mcap.records import Channel, Message

from config.errors import LogError
from config.schema import Config
from drivers.log.header import LogHeader
from drivers.log.names import segment_path, segments
from drivers.log.segment import PART, ChannelTable, ChunkBuffer, Segment
from drivers.log.syncer import Syncer
from drivers.records import Record

FLUSH_NS: Final = 100_000_000
"""Age at which a record leaves the process.

Promised are 0.25 s, and that a kill loses nothing which a port delivered 0.3 s before: the rest is room for the rounds
in which a caller reads its ports and for a busy computer.
"""

SYNC_NS: Final = 900_000_000
"""Age at which what was flushed is forced to the disk: below the 1 s promised."""

RETRY_NS: Final = 1_000_000_000
"""Pause after a refusal before ``tick`` tries the disk again."""

_MIB: Final = 1 << 20
_MINUTE_NS: Final = 60_000_000_000


class LogWriter:
    """Writes the records of one session, in order, into segments ``<session>-0001.mcap`` and so on.

    A segment ends after ``recording.segment_mib`` or ``recording.segment_min``, judged by bytes written and by the
    ``t_ns`` of the records.  Nothing here reads a clock: the caller calls ``tick`` with the time, every 50 ms or so.

    Where the disk refuses a write, LogError is raised, the segment is left as a readable ``.part``, and up to a chunk
    of records waits in memory; each later flush tries a new segment.  Records that had to be given up are counted in
    ``lost_records``, and their sequence numbers are missing in the log.

    With ``resume`` a session whose writer died goes on in its next segment; without, a log of it must not exist.
    """

    def __init__(
        self, folder: Path, session: str, config: Config, versions: dict[str, str], *, resume: bool = False
    ) -> None:
        self._folder = folder
        self._header = LogHeader(config, dict(versions), session)
        self._table = ChannelTable()
        self._buffer = ChunkBuffer()
        self._segment: Segment | None = None
        self._begun_t_ns: int | None = None
        self._oldest_t_ns: int | None = None
        self._unsynced_t_ns: int | None = None
        self._retry_t_ns: int | None = None
        self._closed = False
        self._syncer = Syncer()
        self._next = 1
        self._previous: str | None = None
        self.lost_records = 0
        """Records that could not be written."""
        self._start(resume)

    @property
    def is_writing(self) -> bool:
        """Whether a segment is open; it is not after the disk refused one, until a flush has begun the next."""
        return self._segment is not None

    @property
    def path(self) -> Path:
        """Final path of the newest segment."""
        return segment_path(self._folder, self._header.session, max(1, self._next - 1))

    def write(self, record: Record) -> None:
        """Take ``record`` into the chunk in the making, and write the chunk when it is full.

        Raises LogError; ``record`` itself is then still kept unless it is one that no log can hold.
        """
        if self._closed:
            raise LogError("the log is closed; start a new session")
        channel, message = self._table.message(record)
        try:
            self._make_room(message, record.t_ns)
        finally:
            self._add(channel, message, record.t_ns)

    def flush(self) -> None:
        """Close the chunk in the making and hand it to the operating system; raise LogError where that fails."""
        if not self._buffer.messages:
            return
        segment = self._segment or self._open()
        try:
            segment.write_chunk(self._buffer)
        except OSError as error:
            self._abandon()
            raise self._refused(error) from error
        self._unsynced_t_ns = self._unsynced_t_ns if self._unsynced_t_ns is not None else self._oldest_t_ns
        self._oldest_t_ns = None
        self._buffer.clear()

    def sync(self) -> None:
        """Flush, and wait until everything is on the disk; raise LogError where that fails."""
        self.start_sync()
        try:
            self._syncer.wait()
        except OSError as error:
            self._abandon()
            raise self._refused(error) from error

    @property
    def is_syncing(self) -> bool:
        """Whether the disk is still at work on what was flushed."""
        return self._syncer.is_busy

    def start_sync(self) -> None:
        """Flush, and have everything brought to the disk meanwhile; raise LogError where the flush fails."""
        self.flush()
        if self._segment is not None and self._unsynced_t_ns is not None:
            self._unsynced_t_ns = None
            self._syncer.start(self._segment.syncing())

    def tick(self, t_ns: int) -> None:
        """Flush and sync what has waited long enough at ``t_ns``, on the clock of the records' ``t_ns``.

        It does not wait for the sync; a slow disk makes the next one later.  Raises LogError where the disk refuses,
        and then leaves it in peace for a second.
        """
        if self._retry_t_ns is not None and t_ns < self._retry_t_ns:
            return
        self._retry_t_ns = None
        try:
            if self._oldest_t_ns is not None and t_ns - self._oldest_t_ns >= FLUSH_NS:
                self.flush()
            self._sync_meanwhile(t_ns)
        except LogError:
            self._retry_t_ns = t_ns + RETRY_NS
            raise

    def _sync_meanwhile(self, t_ns: int) -> None:
        if self._syncer.is_busy:
            return
        try:
            self._syncer.check()
        except OSError as error:
            self._abandon()
            raise self._refused(error) from error
        if self._unsynced_t_ns is not None and t_ns - self._unsynced_t_ns >= SYNC_NS:
            self.start_sync()

    def close(self) -> None:
        """Write what is left and give the last segment its name; a second call does nothing.

        Raises LogError; what could not be written is then counted in ``lost_records``.
        """
        if self._closed:
            return
        self._closed = True
        try:
            self.flush()
        finally:
            self._drop_buffer()
            try:
                self._end()
            finally:
                self._close_syncer()

    def __enter__(self) -> LogWriter:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _start(self, resume: bool) -> None:
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise self._refused(error) from error
        earlier = segments(self._folder, self._header.session)
        if earlier and not resume:
            raise LogError(f"a log of session {self._header.session} exists in {self._folder}; choose another session")
        if earlier:
            self._next, newest = max(earlier.items())
            self._next, self._previous = self._next + 1, newest.name.removesuffix(PART)
        self._open()

    def _open(self) -> Segment:
        header = LogHeader(self._header.config, self._header.versions, self._header.session, self._next, self._previous)
        path = segment_path(self._folder, header.session, header.segment)
        try:
            self._segment = Segment(path, header.metadata())
        except OSError as error:
            raise self._refused(error) from error
        self._next, self._previous = self._next + 1, path.name
        return self._segment

    def _make_room(self, message: Message, t_ns: int) -> None:
        if self._is_segment_full(t_ns):
            self.flush()
            self._end()
        if self._buffer.has_room(message):
            return
        try:
            self.flush()
        except LogError:
            self._drop_buffer()
            raise

    def _add(self, channel: Channel, message: Message, t_ns: int) -> None:
        if not self._buffer.has_room(message):
            self._drop_buffer()
        if self._oldest_t_ns is None:
            self._oldest_t_ns = t_ns
        if self._begun_t_ns is None:
            self._begun_t_ns = t_ns
        self._buffer.add(channel, message)

    def _is_segment_full(self, t_ns: int) -> bool:
        if self._begun_t_ns is None:
            return False
        limits = self._header.config.recording
        size = self._buffer.size + (self._segment.size if self._segment is not None else 0)
        return t_ns - self._begun_t_ns >= limits.segment_min * _MINUTE_NS or size >= limits.segment_mib * _MIB

    def _end(self) -> None:
        """Finish the segment; it gets its name once it is on the disk, which nobody waits for."""
        segment, self._segment = self._segment, None
        self._begun_t_ns = self._unsynced_t_ns = None
        if segment is None:
            return
        try:
            segment.finish()
        except OSError as error:
            segment.abandon()
            raise self._refused(error) from error
        self._syncer.start(segment.seal)

    def _close_syncer(self) -> None:
        try:
            self._syncer.close()
        except OSError as error:
            raise self._refused(error) from error

    def _abandon(self) -> None:
        # What follows a write that failed halfway would be found only by search, and a follower may have read the
        # half already: the file is never written again.
        if self._segment is not None:
            self._segment.abandon()
        self._segment = None
        self._unsynced_t_ns, self._begun_t_ns = None, self._oldest_t_ns

    def _drop_buffer(self) -> None:
        self.lost_records += len(self._buffer.messages)
        self._buffer.clear()
        self._oldest_t_ns = None

    def _refused(self, error: OSError) -> LogError:
        return refused(error, self._folder)


def refused(error: OSError, where: Path) -> LogError:
    """Return the LogError that says what to do about ``error`` at ``where``."""
    if error.errno in (errno.ENOSPC, errno.EDQUOT):
        return LogError(f"cannot write {where}: the disk is full; free some space")
    if isinstance(error, FileExistsError):
        return LogError(f"cannot write {error.filename or where}: it exists; choose another name or move it away")
    return LogError(f"cannot write {where}: {error.strerror or error}; check the folder and the disk")
