"""Which runs of a study a page can replay, if not all: every kind of ending of every design, then those at the threshold.

Input: outcomes and times by design and sample. Output: (design, sample) pairs within a number of bytes.
"""

from collections.abc import Container, Iterator

import numpy

from foldcar.figures.compact_path import ROW_BYTES
from foldcar.replay.outcome_grid import NONE, OutcomeGrid
from foldcar.simulation.results import OUTCOMES, REJECTED
from foldcar.simulation.runner import KEPT_INTERVAL_S as INTERVAL_S
from foldcar.study.kept_paths import MOST_BYTES, MOST_RUNS, REPLAYED

REPLAYED_CODES = [1 + OUTCOMES.index(name) for name in REPLAYED]
THRESHOLD = 0.75


def choose_runs(
    grid: OutcomeGrid,
    kept: Container[tuple[int, int]] | None = None,
    most_bytes: int = MOST_BYTES,
    most_runs: int = MOST_RUNS,
) -> list[tuple[int, int]]:
    """The runs to replay in order of design and sample, of the ``kept`` ones if there are any: all shown that fit."""
    chosen: list[tuple[int, int]] = []
    spent = 0.0
    for design, sample in _in_order_of_use(grid):
        if kept is not None and (design, sample) not in kept:
            continue
        spent += ROW_BYTES * (2 + grid.elapsed_s[design, sample] / INTERVAL_S)
        if spent > most_bytes or len(chosen) == most_runs:
            break
        chosen.append((design, sample))
    return sorted(chosen)


def _in_order_of_use(grid: OutcomeGrid) -> Iterator[tuple[int, int]]:
    designs, samples = grid.shown_designs(), grid.shown_samples()
    codes = grid.outcomes[designs][:, samples]
    there = numpy.isin(codes, REPLAYED_CODES)
    counted = ~numpy.isin(grid.outcomes[designs], [NONE, 1 + OUTCOMES.index(REJECTED)])
    success = (grid.outcomes[designs] == 1).sum(axis=1) / numpy.maximum(1, counted.sum(axis=1))
    nearest = [int(row) for row in numpy.argsort(numpy.abs(success - THRESHOLD), kind="stable")]
    taken = numpy.zeros(codes.shape, dtype=bool)
    for row in nearest:
        for code in REPLAYED_CODES:
            found = numpy.flatnonzero(codes[row] == code)
            if len(found):
                taken[row, found[0]] = True
                yield designs[row], samples[int(found[0])]
    for row in nearest:
        for column in numpy.flatnonzero(there[row] & ~taken[row]):
            yield designs[row], samples[int(column)]
