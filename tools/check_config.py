"""``lacuna check-config``: say every mistake of a configuration file, or what it amounts to."""

from __future__ import annotations

import argparse
import json
import sys
from dataclasses import asdict
from pathlib import Path

from config.errors import ConfigError
from config.load import read_config
from config.schema import Config


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's options."""
    parser.add_argument("file", type=Path, help="the configuration file (TOML)")
    parser.add_argument("--json", action="store_true", help="print mistakes and configuration as JSON")


def run(args: argparse.Namespace) -> int:
    """Print the mistakes, one a line, or the summary of a right file."""
    config, mistakes = read_config(args.file)
    if args.json:
        body = None if config is None else config.model_dump(mode="json")
        print(json.dumps({"ok": not mistakes, "mistakes": [asdict(each) for each in mistakes], "config": body}))
    elif config is None:
        for each in mistakes:
            print(f"lacuna: {each}", file=sys.stderr)
    else:
        print(f"{args.file} is right: {_summary(config)}")
    return ConfigError.exit_code if mistakes else 0


def _summary(config: Config) -> str:
    feeds = ", ".join(f"{feed.name} on {feed.port}" for feed in config.feed) or "no feed"
    return (
        f"site {config.site.name}, sonar on {config.sonar.port}, {feeds}, "
        f"snapshots on {config.publish.bind}:{config.publish.port}, logs in {config.recording.folder}"
    )
