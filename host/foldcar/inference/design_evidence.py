"""What a store knows of one design: its runs in sampled environments and the trials of its built cars."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy
from numpy.typing import NDArray

from foldcar.inference.resimulation import SimulatedCars
from foldcar.simulation.results import OUTCOMES
from foldcar.statistics.built_cars import PRIOR, BuiltCars, shift, simulated_weights
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
    ``expected`` is the fraction (0 to 1) of several simulated cars of the design that pass in it, None if they were not
    simulated. ``car_name`` is None if the car has no name.
    """

    outcome: str
    sample: int | None
    simulated: int | None
    resimulated: bool
    expected: float | None = None
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
    are not stored. ``sequential`` is whether a stopping rule ended its runs. ``spread`` are the weights of SPREADS, how
    much its cars differ (:mod:`foldcar.statistics.built_cars`). ``aborted`` trials count in no rate.
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
    spread: NDArray[Any] = field(default_factory=lambda: PRIOR)

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
        cars = "" if self.cars is None else self.cars.text
        return Rate.from_counts(self.trials_passed, len(self.trials), cars, confidence=confidence)

    @cached_property
    def cars(self) -> BuiltCars | None:
        """The trials grouped by car; None without trials."""
        return by_car(self.trials, self.spread, self.runs_passed, self.runs) if self.trials else None

    @property
    def paired(self) -> list[PairedTrial]:
        """The trials with a simulation of their environment."""
        return [trial for trial in self.trials if trial.simulated is not None]


def by_car(trials: Sequence[PairedTrial], spread: NDArray[Any], runs_passed: int, runs: int) -> BuiltCars:
    """Group trials of one design, at least one, by the car that drove.

    ``spread`` are the weights of SPREADS. A car's log-odds are shifted if its environments are easier or harder for
    simulated cars than all environments, in which ``runs_passed`` of ``runs`` passed.
    """
    trials_by_car: dict[str | None, list[PairedTrial]] = {}
    for trial in trials:
        trials_by_car.setdefault(trial.car_name, []).append(trial)
    groups = list(trials_by_car.values())
    counts = [(sum(trial.passed for trial in group), len(group)) for group in groups]
    passed, counted = numpy.array(counts, dtype=float).T
    # Never 0 or 1, so that its log-odds are finite.
    overall = (runs_passed + 0.5) / (runs + 1)
    shifts = [shift([trial.expected for trial in group], overall) for group in groups]
    return BuiltCars(passed, counted, numpy.array(shifts), spread)


def simulated_spread(cars: SimulatedCars | None) -> NDArray[Any]:
    """Return the weights of SPREADS of a design's cars, given its simulated cars; without these, the prior weights."""
    return PRIOR if cars is None else simulated_weights(cars.passed.sum(axis=1), cars.passed.shape[1])


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
