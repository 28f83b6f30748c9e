"""Counts an experiment's trials by design parameter, for comparison with the simulated runs.

Input: trials. Output: tallies. Only cars of the experiment's family count: same modules, same fixed parameters.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field

from foldcar.report.wilson import wilson_interval
from foldcar.store.info import ExperimentInfo
from foldcar.store.trial_records import Trial


@dataclass
class TrialTally:
    """Trials of one design, or of all designs that share a parameter's value; aborted ones are counted separately."""

    counted: int = 0
    passed: int = 0
    aborted: int = 0

    def add(self, trial: Trial) -> None:
        """Count a trial."""
        if trial.counts:
            self.counted += 1
            self.passed += trial.outcome == "passed"
        else:
            self.aborted += 1

    @property
    def success(self) -> float:
        """Share of the counted trials that passed, 0 to 1; at least one must have been counted."""
        return self.passed / self.counted

    @property
    def interval(self) -> tuple[float, float]:
        """Wilson 95 % interval (low, high) of the success, 0 to 1."""
        return wilson_interval(self.passed, self.counted)


@dataclass
class TrialSummary:
    """An experiment's trials: all together, and by the value of each varied parameter, ascending.

    ``unknown_cars`` is the number of trials whose car does not belong to the family.
    """

    total: TrialTally = field(default_factory=TrialTally)
    series: dict[str, dict[float, TrialTally]] = field(default_factory=dict)
    unknown_cars: int = 0


def summarise_trials(trials: Iterable[Trial], info: ExperimentInfo) -> TrialSummary:
    """Count ``trials`` of the experiment ``info``."""
    summary = TrialSummary(series={name: {} for name in info.varied})
    for trial in trials:
        fits = trial.vehicle_type == info.vehicle_type and all(
            trial.design.get(name) == value for name, value in info.fixed.items()
        )
        if not fits:
            summary.unknown_cars += 1
            continue
        summary.total.add(trial)
        for name, by_value in summary.series.items():
            by_value.setdefault(trial.design[name], TrialTally()).add(trial)
    summary.series = {name: dict(sorted(by_value.items())) for name, by_value in summary.series.items()}
    return summary
