"""Reads the trials of an experiment for the belief: which car drove in which scene, and whether it passed.

Input: a store, a swept experiment. Output: Observations. A *cell* is a design in one scene, or a design in any scene of
the experiment. A trial whose scene is known belongs to the cell of that scene, every other trial to its design's cell of
any scene. Trials of a design without a car's name count as trials of one car. Raises FoldcarError.
"""

import json
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from foldcar.belief.priors import FloatArray
from foldcar.errors import FoldcarError
from foldcar.inference.calibration.experiment import PASSED, SweptExperiment
from foldcar.inference.calibration.supply import measured_supply
from foldcar.store.other_drives import other_drives
from foldcar.store.reader import Store
from foldcar.store.trial_records import BUILT, SIMULATED, UNKNOWN, WITHDRAWN, Trial

IntArray = np.ndarray[Any, np.dtype[np.intp]]
ABORTED, OTHER_ENVIRONMENT, NO_DESIGN = "aborted", "other environment", "no design"
# Why a trial is left out, completing "3 …".
_REASONS = {
    SIMULATED: "of simulated cars",
    BUILT: "of built cars",
    UNKNOWN: "of cars that may be built or simulated (`foldcar trials correct --car` says which)",
    WITHDRAWN: "withdrawn",
    ABORTED: "aborted",
    OTHER_ENVIRONMENT: "in another environment than the experiment's",
    NO_DESIGN: "of cars whose design was not swept",
}


@dataclass(frozen=True, slots=True)
class Cell:
    """A design by its index, and a scene as in docs/carsim.md; None stands for any scene of the experiment."""

    design: int
    scene: Mapping[str, Any] | None


@dataclass(frozen=True)
class Observations:
    """Trials: ``cell``, ``car`` (trials,) are indices, ``passed`` (trials,) is 1 or 0.

    ``car_design`` (cars,) is the index of each car's design; ``notes`` are sentences for the reader. ``from_sheets`` is
    true if all cars were built from the sheets. ``supply_ratio`` is the measured voltage of the servos' supply divided by
    the design's, None if it was not measured.
    """

    cells: tuple[Cell, ...]
    cell: IntArray
    car: IntArray
    car_design: IntArray
    passed: FloatArray
    simulated: bool
    notes: tuple[str, ...]
    from_sheets: bool = False
    supply_ratio: float | None = None

    @property
    def design(self) -> IntArray:
        """The index of each trial's design (trials,)."""
        return self.car_design[self.car]

    def counts(self) -> dict[int, tuple[int, int]]:
        """Return numbers of passed and of all trials by the design's index, in ascending order."""
        return {
            int(design): (int(self.passed[self.design == design].sum()), int((self.design == design).sum()))
            for design in np.unique(self.design)
        }

    def without(self, design: int) -> "Observations":
        """Return the trials of the other designs."""
        kept = self.design != design
        return replace(self, cell=self.cell[kept], car=self.car[kept], passed=self.passed[kept])


def experiment_with_trials(store: Store, named: str | None) -> str:
    """Return ``named`` if it has trials; None stands for the only experiment with trials. Raises FoldcarError."""
    with_trials = list(dict.fromkeys(trial.experiment for trial in store.trials()))
    if not with_trials:
        raise FoldcarError(
            f"{store.path}: holds no trials: drive some (`foldcar log`) or import them (`foldcar trials import`)"
        )
    place = f"{store.path}: has"
    return _chosen_experiment(with_trials, named, f"{place} no trials of experiment", f"{place} trials of experiments")


def experiment_to_measure(store: Store, named: str | None) -> str:
    """Return ``named`` if it was swept or has trials; None stands for the only such experiment. Raises FoldcarError."""
    swept = [info.listed_id for info in store.info().experiments.values()] if store.holds_study() else []
    experiments = list(dict.fromkeys([*swept, *(trial.experiment for trial in store.trials())]))
    return _chosen_experiment(experiments, named, f"{store.path}: has no experiment", f"{store.path}: has experiments")


def _chosen_experiment(experiments: list[str], named: str | None, if_unknown: str, if_several: str) -> str:
    """Return the ``named`` experiment, or the only one if ``named`` is None.

    Raises FoldcarError. Its message starts with ``if_unknown`` if the named experiment is not one of ``experiments``, or
    without experiments; with ``if_several`` if a name is needed to choose one of several.
    """
    if named is None and len(experiments) > 1:
        raise FoldcarError(f"{if_several} {', '.join(experiments)}: choose one with --experiment")
    if named is None and experiments:
        return experiments[0]
    if named not in experiments:
        raise FoldcarError(f'{if_unknown} "{named or ""}"; it has {", ".join(experiments) or "none"}')
    return named


def observe(store: Store, experiment: SweptExperiment, simulated: bool) -> Observations:
    """Read the completed trials of built cars and, if ``simulated``, of simulated ones, in the experiment's environment.

    Notes say which trials are left out. Raises FoldcarError if no trial remains.
    """
    name = experiment.info.id
    other_environment = store.trials_in_other_environments(experiment.info)
    ids_in_samples = store.trials_in_environment(experiment.info)
    kept: list[tuple[Trial, int]] = []
    left_out = Counter[str]()
    trials_of_experiment = list(store.trials(name))
    different = other_drives(store, experiment.info, trials_of_experiment)
    for trial in trials_of_experiment:
        design = experiment.design_of(trial.design) if trial.vehicle_type == experiment.info.vehicle_type else None
        if trial.standing != BUILT and not (simulated and trial.standing == SIMULATED):
            left_out[trial.standing] += 1
        elif not trial.completed:
            left_out[ABORTED] += 1
        elif trial.id in other_environment:
            left_out[OTHER_ENVIRONMENT] += 1
        elif design is None:
            left_out[NO_DESIGN] += 1
        elif trial.id in different:
            left_out[f"not driven as the runs ({different[trial.id]})"] += 1
        else:
            kept.append((trial, design))
    reasons = "; ".join(f"{number} {_REASONS.get(key, key)}" for key, number in left_out.items())
    if not kept:
        hint = " (--simulated-trials counts them)" if left_out[SIMULATED] else ""
        raise FoldcarError(f"{store.path}: experiment {name}: no trial counts: {reasons}{hint}")
    notes = [f"Trials left out: {reasons}."] if reasons else []
    result = _observed(store, experiment, kept, ids_in_samples)
    # A car that `foldcar log` drove has reported the hash of its design. How other cars were built is unknown, and a
    # simulated car may have any centre of mass.
    from_sheets = not simulated and all(trial.source is None and trial.design_hash for trial, _ in kept)
    notes += _notes(result, simulated)
    trials = [] if simulated else [trial for trial, _ in kept]
    supply = measured_supply(store.path, trials, experiment.designs[0].body)
    if supply.note is not None:
        notes.append(supply.note)
    return replace(result, simulated=simulated, notes=tuple(notes), from_sheets=from_sheets, supply_ratio=supply.ratio)


def _observed(
    store: Store, experiment: SweptExperiment, trials: Sequence[tuple[Trial, int]], ids_in_samples: set[int]
) -> Observations:
    """Sort trials, each with the index of its design, into cells and cars, which are numbered as they first appear.

    A cell is a design in a scene, None if the trial's scene is unknown; a car is a design and the car's name.
    """
    cells: dict[tuple[int, str | None], int] = {}
    cars: dict[tuple[int, str | None], int] = {}
    cell_of_trial, car_of_trial = [], []
    for trial, design in trials:
        drive = store.trial_drive(trial.id) if trial.id in ids_in_samples else None
        scene = drive.scene if drive is not None else _sampled_scene(experiment, trial, ids_in_samples)
        cell_of_trial.append(cells.setdefault((design, scene), len(cells)))
        car_of_trial.append(cars.setdefault((design, trial.car_name), len(cars)))
    return Observations(
        tuple(Cell(design, None if scene is None else json.loads(scene)) for design, scene in cells),
        np.array(cell_of_trial),
        np.array(car_of_trial),
        # The design of each car.
        np.array([design for design, _ in cars]),
        np.array([float(trial.outcome == PASSED) for trial, _ in trials]),
        simulated=False,
        notes=(),
    )


def _sampled_scene(experiment: SweptExperiment, trial: Trial, ids_in_samples: set[int]) -> str | None:
    """Return the scene of an imported trial's sample as JSON; None if it is not one of the experiment's scenes.

    ``ids_in_samples`` are the ids of the trials that were driven in a sample of the experiment.
    """
    if trial.id not in ids_in_samples or trial.sample is None or trial.sample >= len(experiment.scenes):
        return None
    return json.dumps(experiment.scenes[trial.sample])


def _notes(observed: Observations, simulated: bool) -> list[str]:
    """Return sentences on what the trials cannot show."""
    counts = observed.counts()
    passed, counted = int(observed.passed.sum()), len(observed.passed)
    notes = []
    if simulated:
        notes.append("These are trials of SIMULATED cars: they say nothing about built ones.")
    if len(counts) == 1:
        notes.append("All trials are of one design: one rate cannot tell parameters apart.")
    if passed in (0, counted):
        all_or_none = "All" if passed else "None"
        notes.append(f"{all_or_none} of the {counted} trials passed: they bound the parameters on one side only.")
    return notes
