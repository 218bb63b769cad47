"""``lacuna ports``: the serial ports of this machine, by the names that stay."""

from __future__ import annotations

import argparse
import json
from dataclasses import asdict

from drivers.port import PortInfo, list_ports


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's options."""
    parser.add_argument("--json", action="store_true", help="print the ports as JSON")


def run(args: argparse.Namespace) -> int:
    """Print one port a line: the name for the configuration, what it is called now, the adapter."""
    ports = list_ports()
    if args.json:
        print(json.dumps({"ports": [asdict(port) for port in ports]}))
    elif not ports:
        print("no serial ports; plug the adapter in, or name a serial server as socket://HOST:PORT")
    else:
        rows = [_row(port) for port in ports]
        widths = [max(len(row[column]) for row in rows) for column in range(3)]
        for row in rows:
            cells = [text.ljust(width) for text, width in zip(row, widths, strict=False)]
            print("  ".join([*cells, row[3]]).rstrip())
    return 0


def _row(port: PortInfo) -> tuple[str, str, str, str]:
    device = port.device if port.by_id else ""
    return port.by_id or port.device, device, port.usb or "", port.description
