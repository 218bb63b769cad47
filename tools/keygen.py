"""``lacuna keygen``: CURVE keys for a daemon that is reached from other machines."""

from __future__ import annotations

import argparse
import errno
import os
import shutil
import tempfile
from pathlib import Path

import zmq.auth

from config.errors import InputError, LogError, UsageError


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's options."""
    parser.add_argument("folder", type=Path, metavar="DIR", help="new folder for the keys")


def run(args: argparse.Namespace) -> int:
    """Make the folder whole or not at all, and say what goes where."""
    folder: Path = args.folder
    if folder.exists():
        raise UsageError(f"{folder} exists; keys are never replaced, name a new folder")
    try:
        _make(folder)
    except OSError as error:
        kind = LogError if error.errno in (errno.ENOSPC, errno.EDQUOT, errno.EROFS) else InputError
        raise kind(f"cannot make keys in {folder}: {error.strerror}; choose another folder") from None
    print(
        f'keys are in {folder}: set  keys = "{folder}"  under [publish] on the robot;\n'
        f"copy {folder}/client.key_secret and {folder}/server.key to the laptop: who has them can steer the sonar.\n"
        f"Public keys in {folder}/authorized are let in: add one a client, remove one to shut it out."
    )
    return 0


def _make(folder: Path) -> None:
    folder.parent.mkdir(parents=True, exist_ok=True)
    made = Path(tempfile.mkdtemp(prefix=".keys-", dir=folder.parent))
    before = os.umask(0o077)
    try:
        (made / "authorized").mkdir()
        for name in ("server", "client"):
            zmq.auth.create_certificates(made, name)
            (made / f"{name}.key_secret").chmod(0o600)
        shutil.copy(made / "client.key", made / "authorized" / "client.key")
        made.rename(folder)
    except BaseException:
        shutil.rmtree(made, ignore_errors=True)
        raise
    finally:
        os.umask(before)
