"""Which run ended how: an experiment's outcomes by design and sample.

Input: an experiment's runs. Output: arrays; 9 bytes a run.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy

from foldcar.simulation.results import NUMBERS, OUTCOMES
from foldcar.store.frames import RunArrays
from foldcar.study.kept_paths import shown_designs

# More columns than these cannot be told apart on a screen.
MOST_SAMPLES = 200
NONE = 0


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
