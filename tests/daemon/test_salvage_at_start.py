"""A daemon that was killed leaves its log unfinished; the next one makes it whole while it records."""

from __future__ import annotations

import os
import signal
import time

from drivers.log import read_log
from drivers.records import Event
from tests.daemon.rig import Rig, configuration


def is_of_another_session(rig: Rig, session: str) -> bool:
    newest = rig.newest("health")
    return newest is not None and newest.session != session


def test_an_earlier_crash_is_made_whole_once(rig: Rig, line: tuple[int, str]) -> None:
    ours, theirs = line
    daemon = rig.run(configuration(rig.folder, theirs, rig.ports))
    rig.wait(lambda: rig.pid("acquire") is not None and rig.pid("map") is not None)
    os.write(ours, b"before the crash")
    time.sleep(0.4)
    for name in ("acquire", "map"):
        pid = rig.pid(name)
        assert pid is not None
        os.kill(pid, signal.SIGKILL)
    daemon.kill()
    daemon.communicate()
    (part,) = rig.logs.glob("*.part")
    before, records = part.read_bytes(), list(read_log(part))
    assert records
    whole = part.with_suffix("")

    rig.told.clear()
    rig.run(configuration(rig.folder, theirs, rig.ports))
    rig.wait(lambda: bool(rig.events("note")))
    assert "made whole after a crash" in str(rig.events("note")[0]["text"])
    outcome = rig.stop()
    assert list(read_log(whole)) == records
    assert part.read_bytes() == before
    mine = [path for path in rig.logs.glob("*.mcap") if path.name.startswith(outcome["session"])]
    notes = [each for each in read_log(mine) if isinstance(each, Event) and each.kind == "note"]
    assert len(notes) == 1

    stamp = whole.stat().st_mtime_ns
    time.sleep(1.1)  # a session's name has the second
    rig.told.clear()
    rig.run(configuration(rig.folder, theirs, rig.ports))
    rig.wait(lambda: "map" in rig.health() and is_of_another_session(rig, outcome["session"]))
    rig.stop()
    assert whole.stat().st_mtime_ns == stamp
    assert not rig.events("note")
