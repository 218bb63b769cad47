"""Ids of the messages of the Tritech Seanet serial protocol."""

from __future__ import annotations

from enum import IntEnum
from functools import cache
from typing import Final

HOST: Final = 0xFF
"""Node number of the host; an imaging head is usually node 2."""


class MessageId(IntEnum):
    """Messages that lacuna sends, reads or tells apart (names as in the protocol, without ``mt``)."""

    NULL = 0
    VERSION_DATA = 1
    HEAD_DATA = 2
    ALIVE = 4
    BB_USER_DATA = 6
    AUX_DATA = 8
    TIMEOUT = 15
    REBOOT = 16
    HEAD_COMMAND = 19
    SEND_VERSION = 23
    SEND_BB_USER = 24
    SEND_DATA = 25
    FPGA_VERSION_DATA = 57
    FPGA_CAL_DATA = 63
    STOP_ALIVES = 66


REWRITING: Final = frozenset({20, 21, 22, 41, 42, 70, 71, 72})
"""EraseSector, ProgBlock, CopyBootBlk, FpgaErase, FpgaProgram, ResetToDefaults, ChangeVerData, FpgaProgUsrCde.

They rewrite the head's memory.  Nothing in lacuna can build a frame with one of these ids.
"""


@cache
def name_of(message_id: int) -> str:
    """Name of a message for counters: ``head_data``, or ``id_57`` where the id has no name here."""
    try:
        return MessageId(message_id).name.lower()
    except ValueError:
        return f"id_{message_id}"
