"""What a store knows of one design: its runs in sampled environments and the trials of its built cars."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from numpy.typing import NDArray

from foldcar.simulation.results import OUTCOMES
from foldcar.statistics.rate import Rate
from foldcar.statistics.words import count, design_text
from foldcar.store.info import ExperimentInfo

Design = Mapping[str, float | str]


def design_key(vehicle_type: str, design: Design) -> Any:
    """Return a hashable key that identifies a design."""
    return vehicle_type, tuple(sorted(design.items()))


@dataclass(frozen=True)
class PairedTrial:
    """A completed trial of a built car, with the simulation of its environment.

    ``sample`` is the sampled environment, None if unknown. ``simulated`` is 1 if the run in it passed, 0 if not, None
    without a run; ``resimulated`` is whether that run was made now, in the scene as placed, instead of by the sweep.
    ``car_name`` is None if the car has no name.
    """

    outcome: str
    sample: int | None
    simulated: int | None
    resimulated: bool
    car_name: str | None = None

    @property
    def passed(self) -> bool:
        """Whether the car passed."""
        return self.outcome == "passed"


@dataclass(frozen=True)
class DesignEvidence:
    """The runs and trials of one design.

    ``passed`` (runs,) is whether each run that counts passed, ``samples`` (runs,) are their environments. ``rejected``
    are the environments of rejected runs, which do not count. ``outcomes`` counts all runs by outcome. ``mean_time_s`` is
    the mean time of the runs that count, None without runs. ``swept`` is False for a design with trials only, whose runs
    are not stored. ``sequential`` is whether a stopping rule ended its runs. ``aborted`` trials count in no rate.
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
    sequential: bool = False
    rejected: frozenset[int] = frozenset()

    @property
    def runs(self) -> int:
        """The number of runs that count."""
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
    def outcome_counts(self) -> list[int]:
        """The number of runs of each of OUTCOMES."""
        return [self.outcomes.get(outcome, 0) for outcome in OUTCOMES]

    def simulated(self, confidence: float = 0.95) -> Rate:
        """Return the success rate of its runs. The design must have a run."""
        return Rate.from_counts(self.runs_passed, self.runs, count(self.runs, "run"), self.sequential, confidence)

    def driven(self, confidence: float = 0.95) -> Rate:
        """Return the success rate of the cars that drove its trials. The design must have a trial."""
        method = f"{count(len(self.trials), 'trial')} of {count(self.cars, 'car')}"
        return Rate.from_counts(self.trials_passed, len(self.trials), method, confidence=confidence)

    @property
    def cars(self) -> int:
        """The number of cars that drove. Trials without a car's name are of one car."""
        return len({trial.car_name for trial in self.trials})

    @property
    def paired(self) -> list[PairedTrial]:
        """The trials with a simulation of their environment."""
        return [trial for trial in self.trials if trial.simulated is not None]


def in_family(info: ExperimentInfo, vehicle_type: str, design: Design) -> bool:
    """Return whether a design belongs to the experiment's family, whose designs differ only in the varied parameters."""
    return (
        vehicle_type == info.vehicle_type
        and all(design.get(name) == value for name, value in info.fixed.items())
        and set(design) == {*info.fixed, *info.varied}
    )


def design_label(info: ExperimentInfo, vehicle_type: str, design: Design) -> str:
    """Return the name of a design for readers: its varied parameters, and others that differ from the family's."""
    varied = {name: design[name] for name in info.varied if name in design}
    differing = {name: value for name, value in design.items() if name not in varied and info.fixed.get(name) != value}
    text = design_text(varied | differing)
    return text if vehicle_type == info.vehicle_type else f"{vehicle_type} of {text}"
