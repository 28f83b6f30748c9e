"""What a store tells of each design of an experiment: runs in sampled environments, and trials of built cars.

A trial has beside it what simulation makes of the same environment: the stored run, or a run made now where the trial
was placed otherwise than planned.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from numpy.typing import NDArray

from foldcar.advice.words import count
from foldcar.analysis.anytime import anytime_interval
from foldcar.analysis.intervals import wilson_interval
from foldcar.analysis.rate import Rate
from foldcar.store.info import ExperimentInfo

Design = Mapping[str, float | str]


@dataclass(frozen=True)
class PairedTrial:
    """A completed trial of a built car; ``simulated`` is 1 if simulation passes in its environment, 0 if not.

    ``simulated`` is None where that is not known; ``again`` says that it was simulated now, as it was placed.
    ``sample`` is None where the environment is not known.
    """

    number: int
    outcome: str
    sample: int | None
    simulated: int | None
    again: bool

    @property
    def passed(self) -> bool:
        """Whether the car passed."""
        return self.outcome == "passed"


@dataclass(frozen=True)
class DesignEvidence:
    """One design: ``passed`` (runs,) tells of its runs in the environments ``samples`` (runs,) whether they passed.

    Rejected runs, in the environments ``rejected``, are not among them. ``swept`` is False for a design of trials that
    the sweep lacks, whose runs were made now or are none. ``label`` is its name for the reader, ``outcomes`` counts all
    runs by outcome, ``mean_time_s`` is that of the runs that count (None without).
    ``stopped``: its runs are those of a sweep that stopped when it knew.
    """

    vehicle_type: str
    design: Design
    label: str
    swept: bool
    samples: NDArray[Any]
    passed: NDArray[Any]
    outcomes: Mapping[str, int]
    mean_time_s: float | None
    trials: tuple[PairedTrial, ...] = ()
    aborted: int = 0
    stopped: bool = False
    rejected: frozenset[int] = frozenset()

    def simulated(self, confidence: float = 0.95) -> Rate:
        """The rate of its runs, at least one."""
        return run_rate(self.runs_passed, self.runs, count(self.runs, "run"), self.stopped, confidence)

    @property
    def runs(self) -> int:
        """The number of runs that belong in a rate."""
        return len(self.passed)

    @property
    def runs_passed(self) -> int:
        """The number of runs that passed."""
        return int(self.passed.sum())

    @property
    def trials_passed(self) -> int:
        """The number of trials that passed."""
        return sum(trial.passed for trial in self.trials)

    @property
    def paired(self) -> list[PairedTrial]:
        """The trials with a simulation of their environment."""
        return [trial for trial in self.trials if trial.simulated is not None]


@dataclass(frozen=True)
class Evidence:
    """One experiment: its designs in the order of the family, then those of trials only; ``remarks`` for the reader."""

    info: ExperimentInfo
    designs: tuple[DesignEvidence, ...]
    remarks: tuple[str, ...]

    @property
    def parameters(self) -> tuple[str, ...]:
        """The varied design parameters."""
        return tuple(self.info.varied)

    def in_family(self, one: DesignEvidence) -> bool:
        """Whether a design is one of the family, swept or not: it differs in the varied parameters only."""
        fixed = self.info.fixed
        return (
            one.vehicle_type == self.info.vehicle_type
            and all(one.design.get(name) == value for name, value in fixed.items())
            and set(one.design) == {*fixed, *self.info.varied}
        )

    @property
    def driven(self) -> list[DesignEvidence]:
        """The designs with trials that count."""
        return [one for one in self.designs if one.trials]


def run_rate(passed: int, runs: int, what: str, stopped: bool, confidence: float = 0.95) -> Rate:
    """The share of runs that passed, with its interval; ``what`` was counted, by a sweep that ``stopped`` when it knew.

    Wilson's interval holds for a number of runs that was fixed before: after such a sweep the anytime-valid one holds.
    """
    if stopped:
        low, high = map(float, anytime_interval(passed, runs, confidence))
        return Rate(passed / runs, low, high, confidence, f"anytime-valid interval of {what}")
    return Rate(passed / runs, *wilson_interval(passed, runs, confidence), confidence, f"Wilson interval of {what}")
