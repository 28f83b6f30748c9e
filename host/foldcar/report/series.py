"""Counts a store's runs by design parameter in one pass, in memory independent of the number of runs.

Input: results of runs. Output: tallies and single runs for tables and plots.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy

from foldcar.analysis.rate import interval_name, mean_interval, wilson_interval
from foldcar.simulation.results import NUMBERS, OUTCOMES, REJECTED, Result, has_passed
from foldcar.store.frames import RunArrays

Value = float | str


@dataclass
class Extent:
    """Mean and range of the values that a program recorded under one name."""

    count: int = 0
    total: float = 0.0
    lowest: float = math.inf
    highest: float = -math.inf

    def add(self, value: float) -> None:
        """Count a value."""
        self.count += 1
        self.total += value
        self.lowest = min(self.lowest, value)
        self.highest = max(self.highest, value)

    @property
    def mean(self) -> float:
        """The mean; at least one value must have been counted."""
        return self.total / self.count


@dataclass
class Tally:
    """Outcomes of the runs of one design, or of all designs that share a parameter's value.

    ``judged`` is False where the experiment does not define success: then there is no share of passed runs; of these
    shares the ``counted`` runs are all but the rejected ones. After a sweep that stopped when it knew (``stopped``)
    designs differ in their number of runs: each counts alike.
    """

    judged: bool = True
    outcomes: dict[str, int] = field(default_factory=lambda: dict.fromkeys(OUTCOMES, 0))
    passed_time_s: float = 0.0
    recorded: dict[str, Extent] = field(default_factory=dict)
    stopped: bool = False
    # Counted and passed runs by the design's values, after a sweep that stopped.
    _designs: dict[tuple[Value, ...], list[int]] = field(default_factory=dict)

    def add_design(self, design: Mapping[str, Value], outcomes: Sequence[int], passed_time_s: float) -> None:
        """Count all runs of a design: how many ended in each of OUTCOMES, and the time of those that passed."""
        for outcome, count in zip(OUTCOMES, outcomes, strict=True):
            self.outcomes[outcome] += count
        if self.stopped:
            counts = self._designs.setdefault(tuple(design.values()), [0, 0])
            counts[0] += sum(outcomes) - outcomes[OUTCOMES.index(REJECTED)]
            counts[1] += outcomes[OUTCOMES.index("passed")]
        self.passed_time_s += passed_time_s

    def add(self, result: Result) -> None:
        """Count a run."""
        self.outcomes[result.outcome] += 1
        if self.stopped:
            counts = self._designs.setdefault(tuple(result.design.values()), [0, 0])
            counts[0] += has_passed(result.outcome) is not None
            counts[1] += result.outcome == "passed"
        if result.outcome == "passed":
            self.passed_time_s += result.metrics["elapsed_time_s"] or 0.0
        for name, recorded in result.recorded.items():
            # Booleans count as 0 or 1: their mean is a share.
            if isinstance(recorded.value, int | float):
                self.recorded.setdefault(name, Extent()).add(float(recorded.value))

    @property
    def runs(self) -> int:
        """The number of runs, however they ended."""
        return sum(self.outcomes.values())

    @property
    def rejected(self) -> int:
        """The number of runs that Scenic rejected."""
        return self.outcomes[REJECTED]

    @property
    def counted(self) -> int:
        """The number of runs that belong in a rate."""
        return self.runs - self.rejected

    @property
    def passed(self) -> int:
        """The number of runs that passed."""
        return self.outcomes["passed"]

    @property
    def seen(self) -> list[str]:
        """The outcomes that occurred, in the order of OUTCOMES, and always ``passed``."""
        return [outcome for outcome in OUTCOMES if self.outcomes[outcome] or outcome == "passed"]

    @property
    def success(self) -> float | None:
        """Share of counted runs that passed, 0 to 1; None if success is undefined or no run is counted."""
        if not self.judged or not self.counted:
            return None
        if self.stopped:
            shares = [passed / counted for counted, passed in self._rated]
            return sum(shares) / len(shares)
        return self.passed / self.counted

    @property
    def interval(self) -> tuple[float, float] | None:
        """The 95 % interval (low, high) of the success, 0 to 1; None where there is no success.

        Wilson's, or after a sweep that stopped the anytime-valid one: Wilson's holds for a number of runs fixed before.
        """
        if not self.judged or not self.counted:
            return None
        if self.stopped:
            counted, passed = zip(*self._rated, strict=True)
            return mean_interval(passed, counted, stopped=True)
        return wilson_interval(self.passed, self.counted)

    @property
    def _rated(self) -> list[list[int]]:
        """Counted and passed runs of the designs that have a rate."""
        return [counts for counts in self._designs.values() if counts[0]]

    @property
    def mean_time_s(self) -> float | None:
        """Mean time of the runs that passed (s); None if none did."""
        return self.passed_time_s / self.passed if self.passed else None


@dataclass(frozen=True)
class TimedRun:
    """The run of one design, by its parameter's value, in the sample whose runs are drawn individually."""

    value: Value
    outcome: str
    time_s: float | None


@dataclass
class Series:
    """One varied parameter: a tally for each value, ascending, over all values of the other parameters."""

    parameter: str
    tallies: dict[Value, Tally]
    interval_name: str = "Wilson"


@dataclass
class Summary:
    """One experiment: a series for each varied parameter; ``timed`` is empty unless exactly one varies.

    It is empty, too, where success is undefined: a time to cross is that of a run that passed.
    """

    total: Tally
    series: list[Series]
    timed: list[TimedRun]


def summarise(
    results: Iterable[Result],
    varied: Mapping[str, Any],
    judged: bool = True,
    stopped: bool = False,
    timed_sample: int = 0,
) -> Summary:
    """Count ``results`` of one experiment by each parameter named in ``varied``; the rest as in :class:`Tally`.

    ``timed_sample`` is the sample whose runs are drawn individually.
    """
    total = Tally(judged, stopped=stopped)
    tallies: dict[str, dict[Value, Tally]] = {parameter: {} for parameter in varied}
    timed: list[TimedRun] = []
    for result in results:
        total.add(result)
        for parameter, by_value in tallies.items():
            by_value.setdefault(result.design[parameter], Tally(judged, stopped=stopped)).add(result)
        if judged and result.sample == timed_sample and len(tallies) == 1:
            (parameter,) = tallies
            timed.append(TimedRun(result.design[parameter], result.outcome, result.metrics["elapsed_time_s"]))
    return _summary(total, tallies, timed, stopped)


def summarise_runs(
    runs: RunArrays,
    designs: Sequence[Mapping[str, Value]],
    varied: Mapping[str, Any],
    judged: bool = True,
    stopped: bool = False,
    timed_sample: int = 0,
) -> Summary:
    """As :func:`summarise`, of runs without recorded values, by the million; ``designs`` are the family's."""
    kinds, passed = len(OUTCOMES), OUTCOMES.index("passed")
    elapsed_s = runs.metrics[:, NUMBERS.index("elapsed_time_s")]
    counts = numpy.bincount(runs.design * kinds + runs.outcome, minlength=len(designs) * kinds).reshape(-1, kinds)
    times = numpy.where(runs.outcome == passed, numpy.nan_to_num(elapsed_s), 0.0)
    passed_s = numpy.bincount(runs.design, times, minlength=len(designs))
    total = Tally(judged, stopped=stopped)
    tallies: dict[str, dict[Value, Tally]] = {parameter: {} for parameter in varied}
    for design, outcomes, time_s in zip(designs, counts.tolist(), passed_s.tolist(), strict=True):
        if not any(outcomes):
            continue
        total.add_design(design, outcomes, time_s)
        for parameter, by_value in tallies.items():
            tally = by_value.setdefault(design[parameter], Tally(judged, stopped=stopped))
            tally.add_design(design, outcomes, time_s)
    timed = []
    if judged and len(tallies) == 1:
        (parameter,) = tallies
        for at in numpy.flatnonzero(runs.sample == timed_sample):
            time_s = None if math.isnan(elapsed_s[at]) else float(elapsed_s[at])
            timed.append(TimedRun(designs[runs.design[at]][parameter], OUTCOMES[runs.outcome[at]], time_s))
    return _summary(total, tallies, timed, stopped)


def _summary(
    total: Tally, tallies: Mapping[str, dict[Value, Tally]], timed: list[TimedRun], stopped: bool
) -> Summary:
    series = [
        Series(
            name,
            {v: by_value[v] for v in sorted(by_value, key=_order)},
            interval_name(stopped),
        )
        for name, by_value in tallies.items()
    ]
    return Summary(total, series, sorted(timed, key=lambda run: _order(run.value)))


def _order(value: Value) -> tuple[bool, float, str]:
    """Sort key: numbers by size, then texts alphabetically."""
    return (True, 0.0, value) if isinstance(value, str) else (False, value, "")
