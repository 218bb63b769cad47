"""Hole filling on real maps with simulated loss: our own method beside others, blind, all in one run.

A method sees the damaged grid and nothing else.  Where a figure speaks of cells, a filled cell is right within one
cell of true wall.  Damage hangs on the seed and the map's name alone, so that every method and every run sees the same.
"""

from __future__ import annotations

import multiprocessing
import zlib
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from tools.bench.holes_damage import damage
from tools.bench.holes_figures import figures
from tools.bench.holes_judge import Verdict, judge
from tools.bench.holes_loss import Damaged
from tools.bench.holes_maps import PRIOR_SAW, Source, pieces, read_state, sources
from tools.bench.holes_methods import METHODS
from tools.bench.holes_pictures import draw

Row = dict[str, str | int | float]

OURS: Final = "ours"
_WORKERS: Final = 2


@dataclass(frozen=True, slots=True)
class HoleOptions:
    """What to measure on: ``pieces`` of every map of one ``half`` of those in ``data``, damaged after ``seed``."""

    data: Path
    half: str
    seed: int
    pieces: int
    pictures: Path | None = None


def measure(options: HoleOptions) -> Iterator[Row]:
    """Yield what was measured on, then a row a method.  Raises InputError where there are no maps."""
    maps = sources(options.data, options.half)
    cases = damaged_half(options)
    yield _facts(options, maps, cases)
    verdicts = _judged(cases, options)
    for name in METHODS:
        random = np.random.default_rng(options.seed)
        found = figures([each[name] for each in verdicts], random)
        yield {"method": name} | {key: round(value, 4) for key, value in found.items() if not np.isnan(value)}


def damaged_half(options: HoleOptions) -> list[Damaged]:
    """Cut and damage pieces of every map of a half.  Raises InputError where there are no maps."""
    return [case for source in sources(options.data, options.half) for case in damaged_pieces(source, options)]


def damaged_pieces(source: Source, options: HoleOptions) -> list[Damaged]:
    """Cut pieces out of a map and damage them; pieces in which nothing could be lost are left out."""
    key = zlib.crc32(f"{source.name}{source.path.suffix}".encode())
    random = np.random.default_rng([options.seed, key])
    cut = pieces(read_state(source.path), options.pieces, random)
    made = [damage(f"{source.name}-{number}", piece, random) for number, piece in enumerate(cut)]
    return [each for each in made if each.losses]


def judge_all(case: Damaged) -> dict[str, Verdict]:
    """Let every method fill a damaged piece, and judge it."""
    return {name: judge(case, method(case.seen.copy())) for name, method in METHODS.items()}


def _judged(cases: list[Damaged], options: HoleOptions) -> list[dict[str, Verdict]]:
    if options.pictures:
        for number, case in enumerate(cases):
            draw(options.pictures / f"{number:03d}-{case.name}.png", case, METHODS[OURS](case.seen.copy()))
    with ProcessPoolExecutor(_WORKERS, multiprocessing.get_context("spawn")) as pool:
        return list(pool.map(judge_all, cases))


def _facts(options: HoleOptions, maps: list[Source], cases: list[Damaged]) -> Row:
    facts: Row = {"half": options.half, "seed": options.seed, "maps": len(maps), "pieces": len(cases)}
    facts["names"] = " ".join(dict.fromkeys(each.name for each in maps))
    if flattered := sorted({each.name for each in maps} & PRIOR_SAW):
        facts["WARNING"] = (
            f"the prior of our certainties was learnt on {' '.join(flattered)}: our figures are flattered"
        )
    return facts
