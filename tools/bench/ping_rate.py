"""Pings per second against what the line or the sound's way allows, with an emulated head on a pseudo-terminal."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from config.schema import Sonar
from drivers.tritech.pace import limits
from drivers.tritech.settings import head_command
from drivers.tritech.units import TURN, step_units
from tools.bench.acq_rig import Rig
from tools.bench.figure import Figure, at_most
from tools.emulator.head import Head, HeadOptions, Sounding

BUSY: Final = 1.15
_LOOK_S: Final = 0.002
_PATIENCE_S: Final = 20.0
_TICK_S: Final = 640e-9

CASES: Final = {
    "400 bins, 10 m": (Sonar(), HeadOptions(centring_s=0.5)),
    "400 bins, 75 m": (Sonar(range_m=75.0), HeadOptions(centring_s=0.5)),
    "400 bins, 10 m, half duplex": (Sonar(), HeadOptions(centring_s=0.5, replies_per_request=1)),
}


def measure(folder: Path, seconds: float) -> Iterator[Figure]:
    """Scan for ``seconds`` in each case; see `Figure`."""
    for number, (name, (sonar, options)) in enumerate(CASES.items()):
        place = folder / str(number)
        place.mkdir()
        parameters = head_command(sonar).parameters
        sampling_s = parameters.bins * parameters.ad_interval * _TICK_S
        takes_turns = options.replies_per_request == 1
        least_s = limits(parameters.bins, sampling_s, sonar.baud, takes_turns=takes_turns).ping_s
        with Rig(place, {}, sonar) as rig:
            rig.start()
            ping_s = _scan(rig, Head(_silence, options, time.monotonic_ns()), seconds)
            rig.stop()
        yield Figure(f"revolution at 1.8 deg, {name}", ping_s * TURN / step_units(sonar.step_deg), "s")
        yield at_most(f"ping to ping, {name}", ping_s / least_s, BUSY, "x the line's or sound's limit")


def _scan(rig: Rig, head: Head, seconds: float) -> float:
    """Serve ``head`` until it scans, then for ``seconds``; return the mean time from ping to ping."""
    begun_s = time.monotonic()
    while rig.told["ping"] < 10:
        _serve(rig, head)
        if time.monotonic() - begun_s > _PATIENCE_S:
            raise TimeoutError("no ping came from the emulated head")
    count, begun_s = rig.told["ping"], time.monotonic()
    while time.monotonic() - begun_s < seconds:
        _serve(rig, head)
    return (time.monotonic() - begun_s) / max(rig.told["ping"] - count, 1)


def _serve(rig: Rig, head: Head) -> None:
    t_ns = time.monotonic_ns()
    wire = rig.wires["sonar"]
    if asked := wire.read():
        head.push(t_ns, asked)
    if said := head.tick(t_ns):
        wire.write(said)
    rig.listen()
    time.sleep(_LOOK_S)


def _silence(sounding: Sounding) -> NDArray[np.uint8]:
    return np.zeros(sounding.bins, dtype=np.uint8)
