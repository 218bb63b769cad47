"""Running one of lacuna's own commands inside a bench, without what it says."""

from __future__ import annotations

import contextlib
import io
from collections.abc import Sequence

from config.errors import DataError
from tools.cli import Command, Parser


def run_command(command: Command, words: Sequence[str]) -> str:
    """Run a command's module with the words of a command line; return what it printed.

    Raises what the command raises, and DataError where it ends with another code than 0.
    """
    parser = Parser(prog="lacuna")
    command.add_arguments(parser)
    said = io.StringIO()
    with contextlib.redirect_stdout(said):
        code = command.run(parser.parse_args(list(words)))
    if code:
        raise DataError(f"a command of the bench ended with {code}: {said.getvalue().strip()}")
    return said.getvalue()
