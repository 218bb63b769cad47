from __future__ import annotations

from pathlib import Path

import pytest
import zmq.auth

from config.load import load_config
from tools.cli import main


def test_keys_are_made_for_both_ends(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = tmp_path / "new" / "keys"
    assert main(["keygen", str(folder)]) == 0
    assert str(folder) in capsys.readouterr().out
    for name in ("server", "client"):
        public, secret = zmq.auth.load_certificate(folder / f"{name}.key_secret")
        assert secret is not None
        assert zmq.auth.load_certificate(folder / f"{name}.key")[0] == public
        assert (folder / f"{name}.key_secret").stat().st_mode & 0o077 == 0
    assert zmq.auth.load_certificates(folder / "authorized") == {
        zmq.auth.load_certificate(folder / "client.key")[0]: True
    }
    (tmp_path / "c.toml").write_text(f'[publish]\nbind = "tcp://0.0.0.0"\nkeys = "{folder}"\n')
    assert load_config(tmp_path / "c.toml").publish.keys == str(folder)


def test_keys_are_never_replaced(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["keygen", str(tmp_path / "keys")]) == 0
    before = (tmp_path / "keys" / "server.key").read_bytes()
    assert main(["keygen", str(tmp_path / "keys")]) == 64
    assert "never replaced" in capsys.readouterr().err
    assert (tmp_path / "keys" / "server.key").read_bytes() == before


def test_a_folder_that_cannot_be_made(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "file").touch()
    assert main(["keygen", str(tmp_path / "file" / "keys")]) == 66
    assert capsys.readouterr().err.count("\n") == 1
