"""The command line: a table of commands, each in a module of its own that is imported when it is asked for."""

from __future__ import annotations

import argparse
import importlib
import os
import sys
from typing import Final, Protocol, cast

from config.errors import LacunaError, UsageError

COMMANDS: Final[dict[str, tuple[str, str]]] = {
    "run": ("tools.run", "the daemon: record, map, publish"),
    "demo": ("tools.demo", "an emulated dive, the real daemon on it, and the live page"),
    "replay": ("tools.replay", "map recorded logs as if they were live"),
    "calibrate": ("tools.calibrate", "speed of sound and range offset from a pool of known size"),
    "fill": ("tools.fill_map", "fill the holes of a ROS map_server map"),
    "import": ("tools.import_log", "a foreign recording as a log"),
    "info": ("tools.info", "what is in a log"),
    "salvage": ("tools.salvage", "what can be read of a broken log, into a new one"),
    "dashboard": ("tools.dashboard_command", "the live page in a browser"),
    "view": ("tools.view", "the mesh in an Open3D window"),
    "ports": ("tools.ports", "the serial ports of this machine"),
    "probe": ("tools.probe", "what speaks on a port, at which baud rate"),
    "check-config": ("tools.check_config", "say every mistake of a configuration file"),
    "keygen": ("tools.keygen", "make keys for a daemon that other machines reach"),
    "emulate": ("tools.emulate", "an emulated vehicle on two pseudo-terminals, or recorded to a file"),
    "bench": ("tools.bench_command", "the figures of the README, measured anew"),
}
"""Name of each command, its module, and what it does in one line."""


ONE_THREAD: Final = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS")
"""Numerical libraries read these when they are loaded, in this process and in those that it starts.

How a sum is shared among threads changes its last bits: the same log must give the same bytes on any number of cores.
"""


class Command(Protocol):
    """What a command's module offers."""

    def add_arguments(self, parser: argparse.ArgumentParser) -> None:
        """Declare the command's options."""

    def run(self, args: argparse.Namespace) -> int:
        """Do the work; return the exit code."""


class Parser(argparse.ArgumentParser):
    """An argument parser that ends wrong usage with exit code 64 and one line."""

    def error(self, message: str) -> None:  # type: ignore[override]
        """Raise the usage error that ``main`` prints."""
        raise UsageError(f"{message}; see '{self.prog} --help'")


def main(argv: list[str] | None = None) -> int:
    """Run ``lacuna COMMAND ...`` and return its exit code (design section 5: codes after sysexits.h)."""
    words = sys.argv[1:] if argv is None else argv
    os.environ |= dict.fromkeys(ONE_THREAD, "1")
    try:
        return _dispatch(words)
    except LacunaError as error:
        print(f"lacuna: {error}", file=sys.stderr)
        return error.exit_code
    except KeyboardInterrupt:
        return 130
    except BrokenPipeError:
        # The reader of our output has gone (`lacuna info LOG | head`): nothing is left to say.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0


def _dispatch(words: list[str]) -> int:
    name = words[0] if words and words[0] in COMMANDS else None
    parser = _parser(name)
    args = parser.parse_args(words)
    if name is None:
        parser.print_help()
        return 0 if not words else UsageError.exit_code
    return _command(name).run(args)


def _parser(name: str | None) -> Parser:
    parser = Parser(prog="lacuna", description="Maps flooded places and says how sure it is.")
    parser.add_argument("--version", action="version", version=f"lacuna {_version()}")
    commands = parser.add_subparsers(dest="command", metavar="COMMAND", parser_class=Parser)
    for each, (_, line) in COMMANDS.items():
        child = commands.add_parser(each, help=line, description=line)
        if each == name:
            _command(each).add_arguments(child)
    return parser


def _command(name: str) -> Command:
    return cast("Command", importlib.import_module(COMMANDS[name][0]))


def _version() -> str:
    from importlib.metadata import version

    return version("lacuna")


if __name__ == "__main__":
    sys.exit(main())
