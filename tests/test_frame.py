"""The frame of the project: names, sizes, imports."""

from __future__ import annotations

import ast
import subprocess
import sys
from importlib.metadata import packages_distributions
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("config", "drivers", "mapping", "fill", "daemon", "tools")
SOURCES = sorted(path for package in PACKAGES for path in (ROOT / package).rglob("*.py"))


def test_no_other_distribution_owns_a_package_name() -> None:
    owners = packages_distributions()
    taken = {name: owners[name] for name in PACKAGES if set(owners.get(name, ["lacuna"])) != {"lacuna"}}
    assert taken == {}


def test_only_the_agreed_folders_stand_at_the_top() -> None:
    listed = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=False)
    if listed.returncode:
        pytest.skip("not a git checkout")
    folders = {line.split("/")[0] for line in listed.stdout.splitlines() if "/" in line}
    assert folders <= {*PACKAGES, "tests", ".ci"}


@pytest.mark.parametrize("path", SOURCES, ids=lambda path: str(path.relative_to(ROOT)))
def test_a_file_fits_in_the_head(path: Path) -> None:
    text = path.read_text()
    assert text.count("\n") <= 300
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.FunctionDef):
            assert (node.end_lineno or 0) - node.lineno < 60, f"{node.name} is too long"


def test_the_command_line_and_the_daemon_start_without_open3d() -> None:
    program = (
        "import sys; sys.modules['open3d'] = None\n"
        "import importlib, tools.cli as cli\n"
        "[importlib.import_module(module) for module, _ in cli.COMMANDS.values()]\n"
    )
    done = subprocess.run([sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_core_reads_no_clock_and_opens_nothing() -> None:
    banned = {"time", "threading", "socket", "serial", "subprocess", "asyncio", "zmq", "select", "os"}
    edges = {ROOT / "drivers" / "port.py", *(ROOT / "drivers" / "log").glob("*.py")}
    for path in SOURCES:
        if path.parts[len(ROOT.parts)] not in {"drivers", "mapping", "fill"} or path in edges:
            continue
        for node in ast.walk(ast.parse(path.read_text())):
            names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            if isinstance(node, ast.ImportFrom) and node.module:
                names.append(node.module)
            assert not banned & {name.split(".")[0] for name in names}, path
