"""Counts an experiment's trials by design parameter, for comparison with the simulated runs.

Input: trials. Output: tallies. Only cars of the experiment's family count: same modules, same fixed parameters.
"""

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

from foldcar.analysis.rate import wilson_interval
from foldcar.store.info import ExperimentInfo
from foldcar.store.trial_records import CARS, Trial, select_trials


@dataclass
class TrialTally:
    """Trials of one design, or of all designs that share a parameter's value; aborted ones are counted separately."""

    counted: int = 0
    passed: int = 0
    aborted: int = 0

    def add(self, trial: Trial) -> None:
        """Count a trial."""
        if trial.completed:
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
class TrialGroup:
    """Trials: all together, and by the value of each parameter, ascending."""

    total: TrialTally = field(default_factory=TrialTally)
    series: dict[str, dict[float, TrialTally]] = field(default_factory=dict)

    @classmethod
    def of(cls, trials: Sequence[Trial], parameters: Iterable[str]) -> "TrialGroup":
        """Count ``trials`` by each of the design parameters."""
        group = cls(series={name: {} for name in parameters})
        for trial in trials:
            group.total.add(trial)
            for name, by_value in group.series.items():
                if name in trial.design:
                    by_value.setdefault(trial.design[name], TrialTally()).add(trial)
        group.series = {name: dict(sorted(by_value.items())) for name, by_value in group.series.items()}
        return group


@dataclass
class TrialSummary:
    """An experiment's trials: those of built cars, and apart from them those of simulated ones if they are asked for.

    ``unknown_cars`` is the number of trials whose car does not belong to the family; ``left_out`` counts those that
    do not count, by standing.
    """

    built: TrialGroup
    simulated: TrialGroup
    unknown_cars: int
    left_out: Counter[str]


def summarise_trials(trials: Iterable[Trial], info: ExperimentInfo, with_simulated: bool = False) -> TrialSummary:
    """Count ``trials`` of the experiment ``info``."""
    kept, left_out = select_trials(trials, with_simulated)
    family = [trial for trial in kept if _belongs(trial, info)]
    return TrialSummary(*by_car(family, info.varied), len(kept) - len(family), left_out)


def by_car(trials: Sequence[Trial], parameters: Iterable[str]) -> tuple[TrialGroup, TrialGroup]:
    """The trials of built and those of simulated cars, counted by each of the design parameters."""
    names = list(parameters)
    built, simulated = ([trial for trial in trials if trial.standing == car] for car in CARS)
    return TrialGroup.of(built, names), TrialGroup.of(simulated, names)


def _belongs(trial: Trial, info: ExperimentInfo) -> bool:
    return trial.vehicle_type == info.vehicle_type and all(
        trial.design.get(name) == value for name, value in info.fixed.items()
    )
