"""Water without echoes, for tests of what happens on the lines."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tools.emulator.echoes import Place, Sampling
from tools.emulator.site import Site


class Silence:
    """Stands for `EchoModel`, which takes a millisecond or two a ping."""

    def __init__(self, site: Site, seed: int) -> None:
        pass

    def ping(self, place: Place, bearing_rad: float, sampling: Sampling, number: int) -> NDArray[np.uint8]:
        return np.full(sampling.bins, number % 256, dtype=np.uint8)
