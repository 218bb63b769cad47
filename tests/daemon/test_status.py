from __future__ import annotations

from config.schema import Config
from daemon.status import Status
from daemon.wire import decode


def test_health_puts_the_children_s_words_together() -> None:
    status = Status("s", Config())
    status.take(
        {"v": "1.0", "seq": 3, "t_ns": 1, "ports": {"sonar": {"state": "open", "lost": 1}}, "disk_is_low": False}
    )
    status.take({"map": {"lag_s": 0.5}})
    fields = decode(status.frames((5, 7), {"acquire": (10, 1), "map": (11, 3)}, {"ping": 4})).snapshot.fields
    assert fields["ports"] == {"sonar": {"state": "open", "lost": 1}}
    assert fields["map"] == {"lag_s": 0.5} == status.map
    assert fields["newest"] == {"ping": 4}
    processes = fields["processes"]
    assert isinstance(processes, dict)
    assert processes["map"] == {"pid": 11, "restarts": 2}
    assert status.has_lost("sonar")
    assert not status.has_lost("other")


def test_a_port_whose_acquisition_died_is_down() -> None:
    status = Status("s", Config())
    status.take({"ports": {"sonar": {"state": "open", "lost": 0}}})
    fields = decode(status.frames((5, 7), {"acquire": (None, 1), "map": (None, 0)}, {})).snapshot.fields
    assert fields["ports"] == {"sonar": {"state": "down", "lost": 0}}
