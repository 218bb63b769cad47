"""The log: every byte received or sent, with its time, in MCAP files that survive a crash."""

from drivers.log.follower import Follower
from drivers.log.header import LogHeader
from drivers.log.names import log_files
from drivers.log.onefile import write_log
from drivers.log.reader import read_header, read_log, read_metadata
from drivers.log.salvage import Salvaged, lost_in_words, make_whole, unfinished
from drivers.log.scanner import Damage
from drivers.log.writer import LogWriter

__all__ = [
    "Damage",
    "Follower",
    "LogHeader",
    "LogWriter",
    "Salvaged",
    "log_files",
    "lost_in_words",
    "make_whole",
    "read_header",
    "read_log",
    "read_metadata",
    "unfinished",
    "write_log",
]
