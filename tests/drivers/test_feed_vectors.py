"""Every sentence of the collected vectors says what its instrument's manual says, or is refused for a reason."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Final

import pytest

from config.schema import Feed
from tests.drivers.feedkit import opinions, plain, run

Values = dict[str, float]
DBAR_M: Final = 100 * 100 / (997 * 9.80665)

VECTORS: Final[list[tuple[str, Values, str]]] = [
    # address; heading in degrees, depth and altitude in metres; what is wrong or doubtful
    ("$SDDBT", {"depth": 2.4}, ""),
    ("$SDDBT", {"depth": 22.5}, ""),
    ("$IIDBT", {}, ""),  # no bottom
    ("$SDDPT", {"depth": 2.7}, ""),  # 2.4 below a transducer at 0.3
    ("$SDDPT", {"depth": 2.4}, ""),  # a negative offset is to the keel
    ("$SDDPT", {"depth": 5.7}, ""),
    ("$SDDPT", {"depth": 2.7}, ""),
    ("$SDDPT", {}, ""),
    ("$SDDBS", {"depth": 2.4}, ""),
    ("$SDDBK", {"depth": 2.4}, ""),
    ("$YXMTW", {}, ""),
    ("$YXXDR", {"depth": 12.34}, ""),
    ("$YXXDR", {"depth": (1234.5 - 1013.25) / 100 * DBAR_M}, "suspect"),  # configured below; no tare
    ("$YXXDR", {"depth": (1234.5 - 1013.25) / 100 * DBAR_M}, "suspect"),
    ("$WIXDR", {}, ""),  # the weather's
    ("$PIPS", {"depth": 1.0}, ""),
    ("$PVIPS2", {"depth": 10.988}, ""),
    ("$PRVAT", {"altitude": 0.115, "depth": (1007.3 - 1013.25) / 100 * DBAR_M}, "suspect"),
    ("$PSGDS", {}, ""),  # a sound velocity probe; not read
    ("$HCHDG", {"heading": 85.7}, ""),
    ("$HCHDG", {"heading": 100.7}, ""),
    ("$SDHDG", {"heading": 231.1}, ""),
    ("$HCHDG", {}, ""),
    ("$HCHDM", {"heading": 123.4}, ""),
    ("$HCHDM", {}, ""),
    ("$HEHDT", {"heading": 274.07}, ""),
    ("$HETHS", {"heading": 274.07}, ""),
    ("$HETHS", {}, ""),
    ("$VWVHW", {"heading": 338.9}, ""),
    ("$HEROT", {}, ""),
    ("$HCXDR", {}, ""),
    ("$YXXDR", {}, ""),
    ("$HCXDR", {}, ""),
    ("$PTNTHPR", {"heading": 354.9}, ""),
    ("$PTNTHTM", {"heading": 71.3}, ""),
    ("$PTNTHTM", {"heading": 14223 * 360 / 65536}, ""),
    ("$PTNTHTM", {}, ""),
    ("$PTNTHPR", {"heading": 85.9}, "suspect"),  # high warning
    ("$PASHR", {"heading": 224.19}, ""),
    ("$PSXN", {"heading": 298.57}, ""),
    ("$PRDID", {"heading": 47.31}, ""),
    ("$PHTRO", {}, ""),
    ("$OHPR", {"heading": 328.3}, ""),
    ("$C320.5", {"heading": 320.5}, ""),
    ("$C328.3", {"heading": 328.3, "depth": 21.01}, ""),
    ("$C328.3", {"heading": 328.3}, "suspect"),  # E001: magnetic distortion
    ("$VRDPT", {"depth": 3.2}, ""),
    ("$VRHDG", {"heading": 123.4}, ""),
    ("$VRMTW", {}, ""),
    ("$PVRND", {"heading": 123.4, "depth": 3.2}, ""),
    ("$PVRND", {"heading": 123.4, "depth": 3.2}, ""),
    ("$HCHDM", {}, "checksum"),
    ("$$SDDPT", {"depth": 0.7}, ""),
    ("$SDDPT", {}, "no_checksum"),
    ("$\\x00", {}, "garbled"),
    ("M,0.0", {}, ""),  # the rest of a sentence
    ("$PIPS", {}, "checksum"),  # its maker's sum leaves out the last comma
    ("$HCHDM", {"heading": 123.4}, ""),
]


def sentences(shared_data: Path) -> list[str]:
    lines = (shared_data / "feeds" / "nmea_vectors.txt").read_text().splitlines()
    return [line.split("\t")[0] for line in lines if not line.startswith("#")]


@pytest.mark.parametrize("index", range(len(VECTORS)), ids=lambda index: f"{index}{VECTORS[index][0]}")
def test_a_vector(shared_data: Path, index: int) -> None:
    found = sentences(shared_data)
    assert len(found) == len(VECTORS)
    start, values, doubt = VECTORS[index]
    assert found[index].startswith(start)
    line = found[index].replace("\\x00", "\0").encode() + b"\r\n"
    feed = Feed(port="socket://x:1", provides=("heading", "depth", "altitude"), xdr_pressure_names=("DEPTH",))
    readings, counters = run(feed, [(0, line)])
    told = dict(plain(each) for each in readings)
    assert told == {kind: pytest.approx(value, abs=1e-5) for kind, value in values.items()}
    assert all(math.isfinite(value) for value in told.values())
    worst = {quality for quality, _ in opinions(readings)} - {"good"}
    assert (set(counters.bad) | worst) == ({doubt} if doubt else set())
