"""What the length of a Seanet frame must be, told from as few of its bytes as possible."""

from __future__ import annotations

from typing import Final

from drivers.tritech.ids import MessageId

SMALLEST: Final = 14
LARGEST: Final = 4096
"""Whole frames, in bytes; a reply of 1500 bins takes 1545, and SeaKing packets are larger."""

STAGES: Final = (7, 15, 44)
"""Bytes of a frame after which `flaw` can say more: lengths; id and first count; count of echoes."""

FIXED: Final[dict[int, frozenset[int]]] = {
    MessageId.ALIVE: frozenset({22}),
    MessageId.VERSION_DATA: frozenset({25}),
    MessageId.BB_USER_DATA: frozenset({264, 175}),
    MessageId.FPGA_CAL_DATA: frozenset({80}),
    MessageId.FPGA_VERSION_DATA: frozenset({28}),
    MessageId.REBOOT: frozenset({14}),
    MessageId.SEND_VERSION: frozenset({14}),
    MessageId.SEND_BB_USER: frozenset({14}),
    MessageId.STOP_ALIVES: frozenset({14}),
    MessageId.SEND_DATA: frozenset({18}),
}
"""Sizes of the messages that always have the same one (175: user blocks of older heads that are not DST)."""

HEAD_COMMAND_FORMS: Final = {0x01: 66, 0x1D: 82, 0x1E: 31, 0x0F: 15}
"""Size of a head command by the byte that tells its form."""

_EMPTY_HEAD_DATA: Final = 45
_ONE_PACKET: Final = 0


def flaw(start: bytes | bytearray, size: int) -> str | None:
    """Say why a frame that begins with ``start`` cannot have ``size`` bytes, or None while nothing speaks against it.

    ``start`` holds at least the first seven bytes, of which five are ``@`` and hex digits.  Reasons: ``length`` (the
    two lengths differ or are impossible), ``node`` (the copy of the head's node), ``size`` (not that message's size).
    """
    if not SMALLEST <= size <= LARGEST or int.from_bytes(start[5:7], "little") + 6 != size:
        return "length"
    if len(start) < min(STAGES[1], size):
        return None
    if start[12] not in (start[7], start[8]):
        return "node"
    return None if _fits(start, size) else "size"


def _fits(start: bytes | bytearray, size: int) -> bool:
    message_id = start[10]
    if message_id in FIXED:
        return size in FIXED[message_id]
    if message_id == MessageId.HEAD_COMMAND:
        return size > SMALLEST and HEAD_COMMAND_FORMS.get(start[13]) == size
    if message_id == MessageId.AUX_DATA:
        return size > SMALLEST and _word(start, 13) + 16 == size
    if message_id == MessageId.HEAD_DATA and start[9] == _ONE_PACKET:
        whole = size >= _EMPTY_HEAD_DATA and _word(start, 13) + 14 == size
        return whole and (len(start) < STAGES[2] or _word(start, 42) + _EMPTY_HEAD_DATA == size)
    return True


def _word(start: bytes | bytearray, at: int) -> int:
    return int.from_bytes(start[at : at + 2], "little")
