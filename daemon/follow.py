"""The map's process: follows the growing log through the pipeline, publishes what became new.

Started again, it reads the session from its beginning, for the map is a function of the log; it publishes when it has
caught up.  ``python -m daemon.follow`` is started by the supervisor.
"""

from __future__ import annotations

import os
import sys
import time
from typing import Final

from config.errors import LacunaError
from daemon import snapshots
from daemon.fault import fault
from daemon.job import Job
from daemon.link import READY, Link, take_job
from daemon.pipeline import Pipeline
from daemon.snapshots import Snapshot
from daemon.state import grid_digest, mesh_digest, poses_digest
from drivers.log import Follower
from drivers.records import Json, Record

_LOOK_S: Final = 0.1
_HEALTH_S: Final = 1.0
_GIVES_WAY: Final = 5
"""On a busy computer the acquisition goes first: the map can catch up, a serial line cannot wait."""


class MapProcess:
    """Follows one session until told to stop; reads the log to its end first."""

    def __init__(self, job: Job, link: Link, follower: Follower) -> None:
        self._link = link
        self._clock = job.clock
        self._follower = follower
        self._pipeline = Pipeline(job.config)
        self._is_level = False
        self._is_reading = True
        self._is_owing = False
        self._records = 0
        self._newest: Record | None = None
        self._told_s = 0.0
        self._digests: dict[str, Json] = {}
        self._is_changed = True

    def run(self) -> None:
        """Follow; return when the supervisor asked for the end and the log is read."""
        while True:
            # Asked before reading: what was recorded before the end was asked for is then surely read.
            is_last = self._link.is_stopping
            records = self._follower.poll()
            self._is_reading = bool(records)
            for record in records:
                self._take(record)
            if not records:
                self._reached_the_end()
                if is_last:
                    break
                self._link.wait(_LOOK_S)
            self._tell_health()
        self._say(self._pipeline.finish())
        self._tell_health(is_final=True)

    def _take(self, record: Record) -> None:
        self._records += 1
        self._newest = record
        self._say(self._pipeline.push(record))
        self._tell_health()

    def _reached_the_end(self) -> None:
        if self._is_level and not self._is_owing:
            return
        self._is_level, self._is_owing = True, False
        if self._pipeline.state.stations:
            self._say(self._pipeline.snapshots())

    def _say(self, told: list[Snapshot]) -> None:
        """Publish; where the line was full a part of the grid is missing, so the whole state follows."""
        self._is_changed |= bool(told)
        if self._is_level and not all(self._link.say(each) for each in told):
            self._is_owing = True

    def _tell_health(self, is_final: bool = False) -> None:
        now_s = time.monotonic()
        if not is_final and now_s - self._told_s < _HEALTH_S:
            return
        self._told_s = now_s
        t_ns, utc_ns = self._clock.now()
        self._link.say(snapshots.health(t_ns, utc_ns, {"map": self._health(t_ns, is_final)}))

    def _health(self, t_ns: int, is_final: bool) -> Json:
        if self._is_changed:
            state = self._pipeline.state
            self._digests = {
                "poses": poses_digest(state.stations),
                "grid": grid_digest(state.grid),
                "mesh": mesh_digest(state.mesh),
                "stations": len(state.stations),
                "placed": sum(station.status == "placed" for station in state.stations),
            }
            self._is_changed = False
        behind_ns = t_ns - self._newest.t_ns if self._newest is not None and self._is_reading else 0
        return {
            "lag_s": round(behind_ns / 1e9, 3),
            "records": self._records,
            "newest_utc_ns": None if self._newest is None else self._newest.utc_ns,
            "is_level": self._is_level,
            "is_final": is_final,
            "log_records_missing": self._follower.damage.records_missing,
            **self._digests,
        }


def main() -> int:
    """Follow the session that standard input names."""
    os.nice(_GIVES_WAY)
    os.nice(_GIVES_WAY)
    job = take_job()
    link = Link(job.link, "map", wait_s=2.0, heeds_term=False)
    try:
        link.report(READY, {})
        with Follower(job.folder, job.session) as follower:
            MapProcess(job, link, follower).run()
    except LacunaError as error:
        link.fatal(error)
        return error.exit_code
    except Exception as error:  # noqa: BLE001  (the last place that can tell it in a line)
        link.fatal(fault("map", error))
        return LacunaError.exit_code
    finally:
        link.close()
    return 0


if __name__ == "__main__":
    sys.exit(main())
