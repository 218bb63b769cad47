"""Errors of lacuna: each class says whose fault it is and what to do now.

LacunaError
├── UsageError    the command line          stop, exit 64
├── DataError     the given file's content  stop, exit 65
├── InputError    a file that is not there  stop, exit 66
├── ConfigError   the operator              stop at start, exit 78
├── PortError     the cable                 retry with back-off; at a tool, exit 69
├── FrameError    noise on the line         count, resynchronise, never stop
└── LogError      a file or the disk        skip what is damaged, exit 74

Exit codes are those of sysexits.h.  A message is one line: what failed, and what to do next.
"""

from __future__ import annotations


class LacunaError(Exception):
    """Base of every error that lacuna raises on purpose."""

    exit_code = 70


class UsageError(LacunaError):
    """The command line asks for something that is not offered."""

    exit_code = 64


class DataError(LacunaError):
    """A file was read but its content is not what the command needs."""

    exit_code = 65


class InputError(LacunaError):
    """A named input does not exist or cannot be opened."""

    exit_code = 66


class ConfigError(LacunaError):
    """The configuration is wrong; nothing starts before it is mended."""

    exit_code = 78


class PortError(LacunaError):
    """A port is absent, busy or was lost; opening it again may succeed."""

    exit_code = 69


class FrameError(LacunaError):
    """Bytes on a line are not a frame; decoders count these and never let them out."""

    exit_code = 65


class LogError(LacunaError):
    """A log cannot be written or read."""

    exit_code = 74
