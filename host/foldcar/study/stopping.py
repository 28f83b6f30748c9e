"""Sequential stopping rules of ``--until``: which designs get the next runs, and what is known at the end.

The schedule is a pure function of results; it uses neither a clock nor the number of simulators. A sweep that resumes
repeats the same steps with the stored results. Rejected runs are made, but carry no information.
The intervals hold at all sample sizes simultaneously, so that a design may stop at any size.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy
from numpy.typing import NDArray

from foldcar.errors import FoldcarError
from foldcar.statistics.rate import anytime_interval
from foldcar.statistics.stopping import StoppingRule
from foldcar.store.designs import DesignCounts
from foldcar.study.experiments import Experiment, ListedStudy

# Limits of a half-width in percentage points. MAX_POINTS would be reached without a run.
MAX_POINTS = 50
MIN_POINTS = 0.1


@dataclass(frozen=True)
class DesignState:
    """The result of a design: its counts, and its anytime-valid interval (``low``, ``high``), 0 to 1.

    ``rejected`` of its ``runs`` carry no information; ``decided`` is whether the stopping rule is satisfied.
    """

    experiment: str
    design: Mapping[str, float]
    runs: int
    rejected: int
    passed: int
    low: float
    high: float
    decided: bool


def stopping_rules(until: str, study: ListedStudy) -> dict[str, StoppingRule]:
    """Parse ``--until`` to the stopping rule of each experiment, by id. Raises FoldcarError.

    A stopping rule says when the success rate of a design is known well enough. ``decided`` means: as soon as its
    interval lies above or below each of the experiment's thresholds. ``5pp`` means: as soon as the half-width of the
    interval is 5 percentage points.
    """
    if until == "decided":
        for experiment in study.experiments:
            if not experiment.thresholds:
                problem = "is missing; --until decided needs it, as 0.75 or [0.5, 0.75]"
                raise FoldcarError(f"{experiment.place}.params.threshold: {problem}")
        return {experiment.id: StoppingRule(None, experiment.thresholds) for experiment in study.experiments}
    points = re.fullmatch(r"([0-9]+(?:\.[0-9]+)?) ?pp", until)
    if points is None:
        raise FoldcarError(f"--until: '{until}' is neither decided nor a number of percentage points, such as 5pp")
    half_width_pp = float(points[1])
    if not MIN_POINTS <= half_width_pp < MAX_POINTS:
        raise FoldcarError(f"--until: {until} is not from {MIN_POINTS}pp to below {MAX_POINTS}pp")
    return {experiment.id: StoppingRule(half_width_pp / 100, ()) for experiment in study.experiments}


def design_states(experiment: Experiment, rule: StoppingRule, counts: DesignCounts) -> list[DesignState]:
    """Return the result of each design: how many runs it has, its success rate, and whether ``rule`` is satisfied.

    Rejected runs carry no information, so they are not counted. The success rate is given as an interval that holds at
    whatever number of runs the design stops.
    """
    low, high = anytime_interval(counts.passed, counts.counted, rule.confidence)
    decided = rule.decided(counts.passed, counts.counted)
    return [
        DesignState(
            experiment=experiment.id,
            design=design.columns,
            runs=counts.runs[index],
            rejected=counts.runs[index] - counts.counted[index],
            passed=counts.passed[index],
            low=float(low[index]),
            high=float(high[index]),
            decided=bool(decided[index]),
        )
        for index, design in enumerate(experiment.family)
    ]


# A batch ends where the design would be decided with probability BATCH_CHANCE, and at the latest after BATCH_RUNS runs
# or the fraction BATCH_SHARE of the earlier runs, whichever is more.
BATCH_CHANCE = 0.1
BATCH_RUNS, BATCH_SHARE = 20, 0.25
# How many sample sizes are tried as a batch's end.
BATCH_ENDS = 20
# Minimum size of the first batch: fewer runs would say nothing about a design that then waits.
MIN_RUNS = 5
# A grid of rates that is even in the arcsine: there the prior of Jeffreys is uniform.
RATES = numpy.sin(numpy.pi / 2 * (numpy.arange(64) + 0.5) / 64) ** 2


@dataclass(frozen=True)
class Batch:
    """The next samples of a design, by its position."""

    design: int
    samples: range


class _Counts(NamedTuple):
    """The counts of a design's runs; ``counted`` of its ``runs`` were not rejected, and ``passed`` of these passed."""

    runs: int
    counted: int
    passed: int

    @property
    def rejected(self) -> int:
        """The number of runs that were rejected, which say nothing about the design."""
        return self.runs - self.counted


class Schedule:
    """Decides which runs a sweep with a stopping rule makes next.

    :meth:`next` returns a batch of runs for each design that needs some, and :meth:`record` takes their results. This is
    repeated until every design is closed, which means that it gets no more runs. All designs advance together.
    """

    def __init__(self, rule: StoppingRule, max_runs: int, stored_samples: Sequence[int]) -> None:
        """Begin the schedule of designs with at most ``max_runs`` runs each.

        Runs that an earlier sweep has stored are not made again, and always count. ``stored_samples`` has for each design
        the number of samples, from the first one, in which it may have such runs.
        """
        self._rule, self._max_runs = rule, max_runs
        self._stored_samples = numpy.asarray(stored_samples, int)
        # Each of these arrays has an entry for each design. Of its runs, ``counted`` were not rejected.
        designs = len(stored_samples)
        self.runs = numpy.zeros(designs, int)
        self.counted = numpy.zeros(designs, int)
        self.passed = numpy.zeros(designs, int)
        # Whether the rule has decided the design, and whether it gets no more runs.
        self.decided = numpy.zeros(designs, bool)
        self.closed = numpy.zeros(designs, bool)
        # A design's number of runs after its next batch, which depends only on the counts of its runs so far.
        self._ends: dict[_Counts, int] = {}

    def runs_not_needed(self) -> int:
        """Return how many of the planned runs are not made, because their designs were closed before."""
        runs_left = self._max_runs - self.runs
        return int(runs_left[self.closed].sum())

    def decided_designs(self) -> int:
        """Return how many closed designs the rule has decided."""
        return int((self.decided & self.closed).sum())

    def next(self) -> list[Batch]:
        """Return the batches of the next step; an empty list if every design is closed."""
        return [self._batch(design) for design in numpy.flatnonzero(~self.closed).tolist()]

    def record(self, counts: Mapping[int, tuple[int, int]], batches: Sequence[Batch]) -> None:
        """Record the results of ``batches``, and decide which designs are closed, which means that they get no more runs.

        ``counts`` has, for each design of the batches, how many of its new runs passed and how many were not rejected.
        """
        for batch in batches:
            design = batch.design
            passed, counted = counts[design]
            self.passed[design] += passed
            self.counted[design] += counted
            self.runs[design] = batch.samples.stop
        self.decided = self._rule.decided(self.passed, self.counted)
        # A design is closed only when all its stored runs are counted, even if some of them already satisfy the rule.
        for design in {batch.design for batch in batches}:
            has_counted_stored = self.runs[design] >= self._stored_samples[design]
            self.closed[design] = has_counted_stored and self._needs_no_runs(design)

    def _needs_no_runs(self, design: int) -> bool:
        """Return whether a design is decided, has all its runs, or has little chance to be decided by more runs."""
        counts = self._counts(design)
        if self.decided[design] or counts.runs >= self._max_runs:
            return True
        # Assume that no future run is rejected.
        max_counted = self._max_runs - counts.rejected
        return self._rule.hopeless(counts.passed, counts.counted, max_counted)

    def _batch(self, design: int) -> Batch:
        """Return the next samples of a design."""
        counts = self._counts(design)
        if counts.runs and self._needs_no_runs(design):
            # Nothing is simulated any more, but the remaining stored runs must be counted.
            return Batch(design, range(counts.runs, int(self._stored_samples[design])))
        if counts not in self._ends:
            self._ends[counts] = self._batch_end(counts)
        return Batch(design, range(counts.runs, self._ends[counts]))

    def _batch_end(self, counts: _Counts) -> int:
        """Return how many runs a design has at the end of its next batch.

        Several numbers of runs are tried, from few to many. The result is the first number at which the rule decides the
        design with a probability of at least BATCH_CHANCE, or else the last number.
        """
        max_new_runs = max(BATCH_RUNS, int(BATCH_SHARE * counts.runs))
        last_end = min(self._max_runs, counts.runs + max_new_runs)
        first_end = min(last_end, max(counts.runs + 1, MIN_RUNS))
        ends = numpy.unique(numpy.linspace(first_end, last_end, BATCH_ENDS).round().astype(int))
        # How probable each possible success rate of the design is, given its results so far.
        rate_probabilities = _rate_probabilities(counts.passed, counts.counted)
        for end in ends.tolist():
            # Assume that none of the new runs is rejected.
            counted_at_end = counts.counted + (end - counts.runs)
            chance = self._rule.chance(RATES, rate_probabilities, counts.passed, counts.counted, counted_at_end)
            if chance >= BATCH_CHANCE:
                return int(end)
        return last_end

    def _counts(self, design: int) -> _Counts:
        """Return the counts of a design's runs so far."""
        return _Counts(int(self.runs[design]), int(self.counted[design]), int(self.passed[design]))


def _rate_probabilities(passed: int, counted: int) -> NDArray[numpy.float64]:
    """Return the posterior probability of each success rate in RATES, if ``passed`` of ``counted`` runs passed.

    The result has the shape of RATES, and its sum is 1.
    """
    from scipy.special import xlog1py, xlogy

    log_likelihood = xlogy(passed, RATES) + xlog1py(counted - passed, -RATES)
    # Subtracting the maximum prevents that all likelihoods are rounded to 0.
    likelihood = numpy.exp(log_likelihood - log_likelihood.max())
    return numpy.asarray(likelihood / likelihood.sum())
