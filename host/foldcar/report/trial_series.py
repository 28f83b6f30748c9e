"""Counts an experiment's trials by design parameter, to stand beside the simulated runs.

Only trials of cars that belong to the experiment's family count: same modules, same fixed parameters.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field

from foldcar.report.wilson import wilson_interval
from foldcar.store.info import ExperimentInfo
from foldcar.store.trial_records import Trial


@dataclass
class TrialTally:
    """Trials of one design, or of all that share a parameter's value; aborted ones say nothing about the car."""

    counted: int = 0
    passed: int = 0
    aborted: int = 0

    def add(self, trial: Trial) -> None:
        if trial.counts:
            self.counted += 1
            self.passed += trial.outcome == "passed"
        else:
            self.aborted += 1

    @property
    def success(self) -> float:
        """Share of the counted trials that passed, 0 to 1; there is at least one."""
        return self.passed / self.counted

    @property
    def interval(self) -> tuple[float, float]:
        """Wilson 95 % interval of the success, 0 to 1."""
        return wilson_interval(self.passed, self.counted)


@dataclass
class TrialSummary:
    """An experiment's trials: all together, and per varied parameter by its value, ascending."""

    total: TrialTally = field(default_factory=TrialTally)
    series: dict[str, dict[float, TrialTally]] = field(default_factory=dict)
    strangers: int = 0


def summarise_trials(trials: Iterable[Trial], info: ExperimentInfo) -> TrialSummary:
    """Count ``trials`` of the experiment ``info``; ``strangers`` are those whose car is none of its family."""
    summary = TrialSummary(series={name: {} for name in info.varied})
    for trial in trials:
        fits = trial.vehicle_type == info.vehicle_type and all(
            trial.design.get(name) == value for name, value in info.fixed.items()
        )
        if not fits:
            summary.strangers += 1
            continue
        summary.total.add(trial)
        for name, by_value in summary.series.items():
            by_value.setdefault(trial.design[name], TrialTally()).add(trial)
    summary.series = {name: dict(sorted(by_value.items())) for name, by_value in summary.series.items()}
    return summary
