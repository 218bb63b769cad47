from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from config.errors import DataError, UsageError
from tools.bench.long_dive import long_dive
from tools.bench.stations import measure, pairs, read
from tools.bench.whole_logs import whole


def test_pairs_of_a_real_log_are_near_and_none_is_confidently_wrong(shared_data: Path) -> None:
    figures = pairs(read(shared_data / "stations" / "intel.npz"), "intel")
    assert figures.pairs == 47
    assert figures.near > 0.85
    assert figures.accepted > 0.5
    assert figures.accepted_wrong == 0


def test_a_log_that_is_not_there_is_told(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="--data"):
        next(measure(tmp_path))
    np.savez(tmp_path / "other.npz", a=np.zeros(3))
    with pytest.raises(DataError, match="no log of stations"):
        read(tmp_path / "other.npz")


def test_a_long_dive_goes_up_and_down_a_log(shared_data: Path) -> None:
    log = read(shared_data / "stations" / "intel.npz")
    short = replace(log, sights=log.sights[:4])
    figures = long_dive(short, "intel", late=22)
    assert (figures.early, figures.late) == (20, 22)
    assert min(figures.early_ms, figures.late_ms) > 0.0


@pytest.mark.slow
def test_a_real_log_holds_together_in_pieces_that_are_true(shared_data: Path) -> None:
    figures = whole(read(shared_data / "stations" / "freiburg-079.npz"), "freiburg-079", hinted=False)
    assert figures.in_pieces > 0.75
    assert figures.rmse_m < 0.15
    assert figures.wrong == 0
