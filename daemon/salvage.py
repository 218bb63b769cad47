"""The salvage process: makes whole what an earlier crash left unfinished, while the new session records.

``python -m daemon.salvage`` is started by the supervisor once recording runs.  It has the lowest priority and a
process of its own, so that it holds nothing up; killed, it leaves nothing that the next start would not clear away.
"""

from __future__ import annotations

import os
import shutil
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from config.errors import DataError, LogError
from daemon.job import Job
from daemon.link import NOTE, Link, take_job
from drivers.log import lost_in_words, make_whole, unfinished

_IDLE: Final = 19
_MIB: Final = 1 << 20


def salvage(job: Job) -> Iterator[str]:
    """Make whole each unfinished segment of other sessions in the job's folder; yield what became of it."""
    for part in unfinished(job.folder, job.session):
        if not _has_room(part, job.config.recording.disk_low_mib):
            yield f"{part.name} is left unfinished: the disk is low; free some space and start again"
            continue
        try:
            made = make_whole(part)
        except (DataError, LogError) as error:
            yield f"{part.name} is left unfinished: {error}"
        else:
            lost = lost_in_words(made.damage)
            yield f"{made.path.name} made whole after a crash: {made.records} records; lost: {lost}"


def _has_room(part: Path, low_mib: float) -> bool:
    return shutil.disk_usage(part.parent).free - part.stat().st_size > low_mib * _MIB


def main() -> int:
    """Salvage for the session that standard input names."""
    os.nice(_IDLE)
    job = take_job()
    link = Link(job.link, "salvage", wait_s=2.0, heeds_term=True)
    try:
        for text in salvage(job):
            link.report(NOTE, {"text": text})
    except (LogError, OSError) as error:
        link.report(NOTE, {"text": f"earlier logs cannot be looked at: {error}"})
    finally:
        link.close()
    return 0


if __name__ == "__main__":
    sys.exit(main())
