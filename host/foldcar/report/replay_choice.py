"""Which run ended how, and which runs a page can replay, if not all: every kind of ending of every design, then others.

Input: an experiment's runs. Output: arrays, 9 bytes a run; (design, sample) pairs within a number of bytes.
"""

from collections.abc import Container, Iterator, Mapping, Sequence
from typing import Any

import numpy

from foldcar.simulation.compact_path import ROW_BYTES
from foldcar.simulation.results import NUMBERS, OUTCOMES, REJECTED
from foldcar.simulation.runner import KEPT_INTERVAL_S as INTERVAL_S
from foldcar.store.frames import RunArrays
from foldcar.study.kept_paths import MOST_BYTES, MOST_RUNS, REPLAYED, shown_designs

# More columns than these cannot be told apart on a screen.
MOST_SAMPLES = 200
NONE = 0
REPLAYED_CODES = [1 + OUTCOMES.index(name) for name in REPLAYED]
# Runs of designs near this rate of success come first.
THRESHOLD = 0.75


class OutcomeGrid:
    """``outcomes`` (designs, samples): 0 for no run, else 1 + the place in OUTCOMES; ``elapsed_s`` likewise, NaN unknown.

    ``designs`` are the parameters in the order of the store, ``samples`` how many the experiment has.
    """

    def __init__(self, designs: Sequence[Mapping[str, Any]], samples: int) -> None:
        self.designs = designs
        self.samples = samples
        self.outcomes = numpy.zeros((len(designs), samples), dtype=numpy.uint8)
        self.elapsed_s = numpy.full((len(designs), samples), numpy.nan)

    def enter(self, runs: RunArrays) -> None:
        """Enter the experiment's runs."""
        self.outcomes[runs.design, runs.sample] = 1 + runs.outcome
        self.elapsed_s[runs.design, runs.sample] = runs.metrics[:, NUMBERS.index("elapsed_time_s")]

    def outcome(self, design: int, sample: int) -> str | None:
        """How that run ended; None if there is none."""
        code = int(self.outcomes[design, sample])
        return OUTCOMES[code - 1] if code else None

    def shown_designs(self) -> list[int]:
        """The places of the designs that a page shows: all, or as many as fit, evenly spread over the family."""
        return shown_designs(len(self.designs))

    def shown_samples(self) -> list[int]:
        """The samples that a page shows: all, or each design's first of each outcome and the first."""
        if self.samples <= MOST_SAMPLES:
            return list(range(self.samples))
        wanted: dict[int, None] = {}
        for code in range(1, len(OUTCOMES) + 1):
            ended = self.outcomes[self.shown_designs()] == code
            wanted.update(dict.fromkeys(int(first) for first in ended.argmax(axis=1)[ended.any(axis=1)]))
        for sample in range(MOST_SAMPLES):
            if len(wanted) >= MOST_SAMPLES:
                break
            wanted.setdefault(sample)
        return sorted(list(wanted)[:MOST_SAMPLES])


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
