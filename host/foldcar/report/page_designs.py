"""The designs of an experiment as columns: counts with intervals, belief, verdicts, for the page and its figures."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal

from numpy.typing import NDArray

from foldcar.evidence.comparison import compare_experiment
from foldcar.evidence.evidence import Evidence
from foldcar.report.page_types import Column, DesignTable, Measure, VariedParameter
from foldcar.statistics import rate
from foldcar.statistics.gap import OPTIMISTIC, PESSIMISTIC
from foldcar.statistics.words import label_and_unit

Interval = tuple[float, float] | None
Band = tuple[float, float, float] | None


@dataclass(frozen=True)
class DesignColumns:
    """The designs of the family, in the order of ``evidence``.

    An interval is (low, high), a band (rate, low, high), all 0 to 1 at 95 %; None without a rate.
    """

    evidence: Evidence

    @property
    def names(self) -> list[str]:
        """The designs' names for readers."""
        return [design.label for design in self.evidence.family]

    @cached_property
    def run_intervals(self) -> list[Interval]:
        """The intervals of the simulated rates."""
        return self.intervals(self.evidence.run_counts, self.evidence.info.until is not None)

    @cached_property
    def trial_intervals(self) -> list[Interval]:
        """The intervals of the rates of the cars that drove the trials."""
        return self.intervals(self.evidence.trial_counts)

    @property
    def interval_name(self) -> str:
        """The name of the intervals of simulated rates."""
        return rate.interval_name(self.evidence.info.until is not None)

    def intervals(self, counts: NDArray[Any], sequential: bool = False) -> list[Interval]:
        """Return the interval of each design's success rate; None for a design without runs.

        ``counts`` (designs, 2) are the number of runs that passed and the number of all runs. ``sequential`` is whether a
        stopping rule ended the runs.
        """
        if not self.evidence.info.success_defined:
            return [None] * len(counts)
        intervals: list[Interval] = []
        for passed, counted in counts.tolist():
            if not counted:
                intervals.append(None)
                continue
            low, high = rate.rate_interval(passed, counted, sequential)
            intervals.append((round(low, 6), round(high, 6)))
        return intervals

    @property
    def simulation(self) -> list[Band]:
        """The rate of success of each design in simulation, with its interval: (rate, low, high).

        It is None for a design without runs.
        """
        bands: list[Band] = []
        for interval, (passed, runs) in zip(self.run_intervals, self.evidence.run_counts.tolist(), strict=True):
            if interval is None:
                bands.append(None)
                continue
            low, high = interval
            bands.append((passed / runs, low, high))
        return bands

    @cached_property
    def built(self) -> list[Band]:
        """The success rate of a newly built car of each design, with its interval: (rate, low, high).

        It is None for a design that does not belong to the belief, and for all designs if there is no belief.
        """
        bands: list[Band] = [None] * len(self.names)
        belief = self.evidence.belief
        if belief is None:
            return bands
        for index, estimate in zip(belief.design_indices.tolist(), belief.answers.built, strict=True):
            bands[index] = round(estimate.value, 6), round(estimate.low, 6), round(estimate.high, 6)
        return bands

    def page(self, threshold: float, measures: list[Measure]) -> DesignTable:
        """Return the page's table of designs, column by column. Each column has an entry for each design.

        ``threshold`` is the success rate that a good design reaches.
        """
        evidence, family = self.evidence, self.evidence.family
        driven = evidence.belief is not None and evidence.belief.driven
        # If a car was driven, verdicts are about the rates of built cars. Otherwise they are about the rates in
        # simulation.
        judged = self.built if driven else self.simulation
        index_by_value = {}
        for name, values in evidence.values.items():
            index_by_value[name] = {value: index for index, value in enumerate(values)}
        # For each design and each parameter that varies: the index of its value among all values of the parameter.
        value_indices = []
        for design in family:
            value_indices.append([index_by_value[name][float(design.design[name])] for name in index_by_value])
        # Where the trials contradict simulation, the page marks the design.
        verdict_by_name = {design.label: design.verdict for design in compare_experiment(evidence).designs}
        refuted = []
        for name in self.names:
            design_verdict = verdict_by_name.get(name)
            refuted.append(design_verdict if design_verdict in (OPTIMISTIC, PESSIMISTIC) else None)
        return {
            "value": value_indices,
            "name": self.names,
            "swept": [design.swept for design in family],
            "runs": evidence.run_counts[:, 1].tolist(),
            "passed": evidence.run_counts[:, 0].tolist(),
            "rate": [round(passed / runs, 6) if runs else None for passed, runs in evidence.run_counts.tolist()],
            "low": _column(self.run_intervals, 0),
            "high": _column(self.run_intervals, 1),
            "outcomes": evidence.outcome_counts.T.tolist(),
            "trials": evidence.trial_counts[:, 1].tolist(),
            "trials_passed": evidence.trial_counts[:, 0].tolist(),
            "cars": [design.cars for design in family],
            "trials_low": _column(self.trial_intervals, 0),
            "trials_high": _column(self.trial_intervals, 1),
            "belief": _column(self.built, 0),
            "belief_low": _column(self.built, 1),
            "belief_high": _column(self.built, 2),
            "verdict": [verdict(band, threshold) for band in judged],
            "refuted": refuted,
            "measures": measures,
        }


def parameter_columns(evidence: Evidence) -> list[VariedParameter]:
    """Return the parameters that vary, with all values that occur."""
    columns: list[VariedParameter] = []
    for name, values in evidence.values.items():
        label, unit = label_and_unit(name)
        columns.append({"name": name, "label": label, "unit": unit, "values": values})
    return columns


def verdict(band: Band, threshold: float) -> Literal["good", "bad", "open"] | None:
    """Return "good" or "bad" if the band is on one side of the ``threshold``, else "open"; None without a band."""
    if band is None:
        return None
    _, low, high = band
    if low >= threshold:
        return "good"
    if high < threshold:
        return "bad"
    return "open"


def _column(rows: Sequence[tuple[float, ...] | None], index: int) -> Column:
    """Return the column of the numbers at ``index`` of intervals or bands."""
    return [None if row is None else row[index] for row in rows]
