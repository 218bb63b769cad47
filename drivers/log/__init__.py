"""The log: every byte received or sent, with its time, in MCAP files that survive a crash."""

from drivers.log.follower import Follower
from drivers.log.header import LogHeader
from drivers.log.names import log_files
from drivers.log.onefile import write_log
from drivers.log.reader import read_header, read_log, read_metadata
from drivers.log.scanner import Damage
from drivers.log.writer import LogWriter

__all__ = [
    "Damage",
    "Follower",
    "LogHeader",
    "LogWriter",
    "log_files",
    "read_header",
    "read_log",
    "read_metadata",
    "write_log",
]
