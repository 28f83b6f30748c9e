"""Sweeps that stop when they know: the rules of ``--until``, which designs get the next runs, what is known at the end.

The schedule is a pure function of results: no clock, no number of simulators. A sweep that resumes goes through the same
steps with the results that it finds. Rejected runs are made like others, but tell nothing. Every sample size is a valid
one to stop at, however it was chosen, since the intervals hold at all of them together: so another engine's rates may
order runs and size batches. They may not set the stakes of the bets behind the intervals: both engines drive in the same
environments, and luck in those would count twice.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy
from numpy.typing import NDArray

from foldcar.errors import FoldcarError
from foldcar.statistics.engine_bias import RATES, predicted_rates
from foldcar.statistics.rate import anytime_interval
from foldcar.statistics.stopping import StoppingRule
from foldcar.store.designs import DesignCounts
from foldcar.study.experiments import Experiment, Study

# Percentage points: an interval of half this width and more is known without a run.
MAX_POINTS = 50
MIN_POINTS = 0.1


@dataclass(frozen=True)
class DesignState:
    """What a sweep knows of a design: its counts and its anytime-valid interval (``low``, ``high``), 0 to 1.

    Of its ``runs``, the ``rejected`` ones tell nothing of it.
    """

    experiment: str
    design: Mapping[str, float]
    runs: int
    rejected: int
    passed: int
    low: float
    high: float
    decided: bool


def stopping_rules(until: str, study: Study) -> dict[str, StoppingRule]:
    """The rules of ``--until``, ``decided`` or as ``5pp``, by the experiment's id. FoldcarError."""
    if until == "decided":
        for experiment in study.experiments:
            if not experiment.thresholds:
                what = "is missing; --until decided needs it, as 0.75 or [0.5, 0.75]"
                raise FoldcarError(f"{experiment.place}.params.threshold: {what}")
        return {experiment.id: StoppingRule(None, experiment.thresholds) for experiment in study.experiments}
    points = re.fullmatch(r"([0-9]+(?:\.[0-9]+)?) ?pp", until)
    if points is None:
        raise FoldcarError(f"--until: '{until}' is neither decided nor percentage points, as 5pp")
    width = float(points[1])
    if not MIN_POINTS <= width < MAX_POINTS:
        raise FoldcarError(f"--until: {until} is not from {MIN_POINTS}pp to below {MAX_POINTS}pp")
    return {experiment.id: StoppingRule(width / 100, ()) for experiment in study.experiments}


def design_states(experiment: Experiment, rule: StoppingRule, counts: DesignCounts) -> list[DesignState]:
    """What is known of each design of the experiment."""
    low, high = anytime_interval(counts.passed, counts.counted, rule.confidence)
    decided = rule.decided(counts.passed, counts.counted)
    columns = [design.columns for design in experiment.family]
    rejected = [runs - counted for runs, counted in zip(counts.runs, counts.counted, strict=True)]
    known = zip(columns, counts.runs, rejected, counts.passed, low.tolist(), high.tolist(), decided.tolist(), strict=True)
    return [DesignState(experiment.id, *one) for one in known]


# A batch ends where the design is decided with this chance, or after so many runs or this share of those before.
BATCH_CHANCE = 0.1
BATCH_RUNS, BATCH_SHARE = 20, 0.25
# Sample sizes that are tried as a batch's end.
BATCH_ENDS = 20
# The first batch has as many at least: fewer tell nothing of a design that is then left.
MIN_RUNS = 5
# A step has so many runs, and takes this share of the open designs: simulators wait for each other at its end.
STEP_RUNS, STEP_SHARE = 64, 0.125


@dataclass(frozen=True)
class Batch:
    """The next samples of a design, by its position."""

    design: int
    samples: range


class Schedule:
    """The state of a sweep: :meth:`next` gives batches, :meth:`record` takes their results, until there are none.

    ``reached`` is, of each design, 1 + its highest stored sample: what is stored is judged. ``other`` are counts
    (passed, counted), both (designs,), in another engine; None: designs go side by side in the listing's order. Of the
    ``runs`` that were made, ``counted`` ones belong in a rate.
    """

    def __init__(
        self,
        rule: StoppingRule,
        most: int,
        reached: Sequence[int],
        other: tuple[Sequence[int], Sequence[int]] | None = None,
    ) -> None:
        self._rule, self._most, self._other = rule, most, other
        self._reached = numpy.asarray(reached, int)
        self.passed = numpy.zeros(len(reached), int)
        self.runs = numpy.zeros(len(reached), int)
        self.counted = numpy.zeros(len(reached), int)
        self.decided = numpy.zeros(len(reached), bool)
        self.closed = numpy.zeros(len(reached), bool)
        # Without predictions designs with equal counts get equal batches.
        self._ends: dict[tuple[int, int, int], int] = {}
        self._runs_to_decide = _runs_to_decide(rule, most)

    def next(self) -> list[Batch]:
        """The batches of the next step; none if every design is closed."""
        still = numpy.flatnonzero(~self.closed)
        if not len(still):
            return []
        there = self._other or (numpy.zeros_like(self.runs), numpy.zeros_like(self.runs))
        masses = predicted_rates(self.passed, self.counted, *there)
        if self._other is None:
            return [self._batch(design, masses[design]) for design in still.tolist()]
        worth = self._bits_per_run(masses[still], self.counted[still])
        batches: list[Batch] = []
        # Of equals the first one in the listing: the sort is stable, the last digits of sums are not.
        for at in numpy.argsort(-worth.round(9), kind="stable"):
            if len(batches) >= STEP_SHARE * len(still) and sum(len(batch.samples) for batch in batches) >= STEP_RUNS:
                break
            design = int(still[at])
            batches.append(self._batch(design, masses[design]))
        return batches

    def record(self, counts: Mapping[int, tuple[int, int]], batches: Sequence[Batch]) -> None:
        """The results of a step: of each design's new samples, how many passed and how many belong in a rate."""
        for batch in batches:
            design = batch.design
            passed, counted = counts[design]
            self.passed[design] += passed
            self.counted[design] += counted
            self.runs[design] = batch.samples.stop
        self.decided = self._rule.decided(self.passed, self.counted)
        for design in {batch.design for batch in batches}:
            self.closed[design] = self.runs[design] >= self._reached[design] and self._ended(design)

    def _ended(self, design: int) -> bool:
        passed, runs, counted = int(self.passed[design]), int(self.runs[design]), int(self.counted[design])
        # No run to come is taken to be rejected.
        most = self._most - (runs - counted)
        return bool(self.decided[design]) or runs >= self._most or self._rule.hopeless(passed, counted, most)

    def _batch(self, design: int, masses: NDArray[numpy.float64]) -> Batch:
        passed, runs, counted = int(self.passed[design]), int(self.runs[design]), int(self.counted[design])
        if runs and self._ended(design):
            return Batch(design, range(runs, int(self._reached[design])))
        if self._other is not None:
            return Batch(design, range(runs, self._end(passed, runs, counted, masses)))
        known = passed, runs, counted
        if known not in self._ends:
            self._ends[known] = self._end(*known, masses)
        return Batch(design, range(runs, self._ends[known]))

    def _end(self, passed: int, runs: int, counted: int, masses: NDArray[numpy.float64]) -> int:
        last = min(self._most, runs + max(BATCH_RUNS, int(BATCH_SHARE * runs)))
        first = min(last, max(runs + 1, MIN_RUNS))
        for end in numpy.unique(numpy.linspace(first, last, BATCH_ENDS).round().astype(int)).tolist():
            if self._rule.chance(RATES, masses, passed, counted, end - runs + counted) >= BATCH_CHANCE:
                return int(end)
        return last

    def _bits_per_run(self, masses: NDArray[numpy.float64], runs: NDArray[numpy.int_]) -> NDArray[numpy.float64]:
        """What is unknown of each design's side of the thresholds (bits), for each run that it is expected to need."""
        left = (masses * numpy.maximum(self._runs_to_decide - runs[:, None], 1)).sum(axis=1)
        if not self._rule.thresholds:
            return numpy.asarray(1 / left)
        zones = numpy.searchsorted(self._rule.thresholds, RATES)
        sides = numpy.stack([masses[:, zones == zone].sum(axis=1) for zone in range(zones.max() + 1)])
        bits = -(sides * numpy.log2(numpy.maximum(sides, 1e-300))).sum(axis=0)
        result: NDArray[numpy.float64] = bits / left
        return result


def _runs_to_decide(rule: StoppingRule, most: int) -> NDArray[numpy.float64]:
    """The number of runs (RATES,) that decides a design, at most ``most``, if the share that passes is its rate."""
    sizes = numpy.unique(numpy.geomspace(1, most, 60).round())
    decided = rule.decided(RATES[:, None] * sizes, numpy.broadcast_to(sizes, (len(RATES), len(sizes))))
    return numpy.where(decided.any(axis=1), sizes[decided.argmax(axis=1)], float(most))
