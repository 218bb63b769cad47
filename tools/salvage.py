"""``lacuna salvage``: what can be read of a broken log, into a new and sound one; the original stays as it is."""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from pathlib import Path

from config.errors import DataError, LogError, UsageError
from config.load import load_config
from drivers.log import Damage, LogHeader, log_files, lost_in_words, read_log, read_metadata, write_log
from drivers.log.header import check_format, signed
from drivers.records import Event, Json, Record
from tools.progress import counted


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's options."""
    parser.add_argument("log", type=Path, nargs="+", help="a log (*.mcap, *.mcap.part) or a folder with one session")
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="LOG2", help="the log to write (*.mcap)")
    parser.add_argument("--config", type=Path, metavar="F", help="the configuration, where the log's own is lost")
    parser.add_argument("--json", action="store_true", help="print the facts as JSON")


def run(args: argparse.Namespace) -> int:
    """Write the new log, and say what was lost."""
    files = log_files(args.log)
    if args.output.exists():
        raise LogError(f"{args.output} exists; choose another name with -o or move it away")
    metadata = _metadata(files, args.config, args.output)
    damage = Damage()
    count = write_log(args.output, metadata, counted(salvaged(files, damage), "records saved"))
    if args.json:
        print(json.dumps({"log": str(args.output), "records": count, "lost": asdict(damage)}))
        return 0
    print(f"{args.output}: {count} records from {len(files)} file(s)")
    print(f"  lost: {lost_in_words(damage)}")
    return 0


def salvaged(files: Sequence[Path], damage: Damage) -> Iterator[Record]:
    """Yield what is readable of ``files``, and at the end a note of what was lost, since the new log looks whole."""
    last: Record | None = None
    for last in read_log(files, damage):
        yield last
    if last is not None:
        lost: dict[str, Json] = {**asdict(damage)}
        text = f"salvaged from {', '.join(path.name for path in files)}; lost: {lost_in_words(damage)}"
        yield Event(last.t_ns, last.utc_ns, "note", {"text": text, "lost": lost})


def _metadata(files: Sequence[Path], config: Path | None, output: Path) -> dict[str, str]:
    """Return the first readable header, unvalidated, since an old one may not pass; or one made from ``config``.

    Raises UsageError for files of several sessions: their clocks cannot stand in one log.
    """
    found: dict[str, dict[str, str]] = {}
    failure: DataError | None = None
    for path in files:
        try:
            metadata = read_metadata(path)
        except DataError as error:
            failure = failure or error
            continue
        check_format(metadata, path.name)
        found.setdefault(metadata.get("session", ""), metadata)
    if len(found) > 1:
        raise UsageError(f"the files are of several sessions ({', '.join(sorted(found))}); salvage one at a time")
    if config is not None:
        return LogHeader(load_config(config), {}, output.stem).metadata()
    if found:
        # A name of its own: read beside the original, it must not be taken for more of the same session.
        session, metadata = next(iter(found.items()))
        return signed(metadata | {"session": output.stem, "segment": "1", "previous": "", "salvaged_from": session})
    raise failure or DataError(f"{files[0]}: nothing in it is readable")
