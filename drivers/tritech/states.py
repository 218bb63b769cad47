"""States of the conversation with a head: what each sends, how long it waits, and where each answer leads.

Power or ReBoot -> Alive while the transducer centres -> version -> settings block -> head command -> Alive with
parameters -> requests and pings (Tritech Seanet protocol).  The version must be asked for before some firmware works;
the settings block may stay unanswered by old firmware.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import Final

from drivers.tritech.messages import Alive, HeadInf

SECOND_NS: Final = 1_000_000_000


class State(Enum):
    """Where the conversation stands."""

    SILENT = "silent"
    CENTRING = "centring"
    VERSION = "version"
    USER_BLOCK = "user_block"
    SETTING = "setting"
    SCANNING = "scanning"
    REBOOTING = "rebooting"
    STOPPED = "stopped"


class Event(Enum):
    """What the head said."""

    CENTRING = "alive, without parameters, transducer not centred yet"
    CENTRED = "alive, without parameters, centred"
    READY = "alive, with parameters"
    VERSION = "version"
    USER_BLOCK = "settings block"
    PING = "a ping made with the settings that were sent"
    LOST = "a ping after which the settings must be sent again"


class Sends(Enum):
    """What a state sends when it is entered and whenever its wait is over."""

    NOTHING = "nothing"
    VERSION = "SendVersion"
    USER_BLOCK = "SendBBUser"
    SETTINGS = "HeadCommand"
    REQUEST = "SendData"
    REBOOT = "ReBoot"


@dataclass(frozen=True, slots=True)
class Step:
    """A state's row: it sends after ``first_ns``, again every ``every_ns``, and after ``tries`` goes on to ``then``."""

    sends: Sends
    every_ns: int
    tries: int
    then: State
    first_ns: int = 0


STEPS: Final = {
    # An idle head says Alive once a second: listen first, then ask, since a head may have been told to be quiet.
    State.SILENT: Step(Sends.VERSION, SECOND_NS, 60, State.REBOOTING, first_ns=5 * SECOND_NS // 2),
    State.CENTRING: Step(Sends.NOTHING, 60 * SECOND_NS, 1, State.REBOOTING),
    State.VERSION: Step(Sends.VERSION, SECOND_NS, 5, State.USER_BLOCK),
    State.USER_BLOCK: Step(Sends.USER_BLOCK, SECOND_NS, 3, State.SETTING),
    State.SETTING: Step(Sends.SETTINGS, 2 * SECOND_NS, 5, State.SCANNING),
    # The wait for a ping depends on the settings: see `drivers.tritech.requests`.
    State.SCANNING: Step(Sends.REQUEST, 0, 5, State.SETTING),
    State.REBOOTING: Step(Sends.REBOOT, 5 * SECOND_NS, 1, State.SILENT),
    State.STOPPED: Step(Sends.NOTHING, 3600 * SECOND_NS, 1, State.STOPPED),
}

TRANSITIONS: Final = {
    (State.SILENT, Event.CENTRING): State.CENTRING,
    (State.SILENT, Event.CENTRED): State.VERSION,
    (State.SILENT, Event.READY): State.VERSION,
    (State.SILENT, Event.VERSION): State.USER_BLOCK,
    (State.SILENT, Event.PING): State.VERSION,
    (State.SILENT, Event.LOST): State.VERSION,
    (State.CENTRING, Event.CENTRED): State.VERSION,
    (State.CENTRING, Event.READY): State.VERSION,
    (State.VERSION, Event.CENTRING): State.CENTRING,
    (State.VERSION, Event.VERSION): State.USER_BLOCK,
    (State.USER_BLOCK, Event.CENTRING): State.CENTRING,
    (State.USER_BLOCK, Event.USER_BLOCK): State.SETTING,
    (State.SETTING, Event.CENTRING): State.CENTRING,
    (State.SETTING, Event.READY): State.SCANNING,
    (State.SETTING, Event.PING): State.SCANNING,
    (State.SCANNING, Event.CENTRING): State.CENTRING,
    (State.SCANNING, Event.CENTRED): State.VERSION,
    (State.SCANNING, Event.LOST): State.SETTING,
    (State.REBOOTING, Event.CENTRING): State.CENTRING,
    (State.REBOOTING, Event.CENTRED): State.VERSION,
}
"""What is not listed changes nothing."""


def event_of(alive: Alive) -> Event:
    """Read an Alive.  A clear NO_PARAMETERS is trusted whatever else it says: the other bits vary between heads."""
    if HeadInf.NO_PARAMETERS not in alive.info:
        return Event.READY
    centred = HeadInf.CENTRED in alive.info and HeadInf.MOTORING not in alive.info
    return Event.CENTRED if centred else Event.CENTRING
