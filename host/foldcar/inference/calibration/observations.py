"""The trials of an experiment as a calibration takes them: where which car drove, and what is known of how it went.

Input: a store, a swept experiment. Output: Observations. A trial whose place is known is one of its own *cell*, a design
in the scene as it was placed; all others of a design are in its cell of any scene. Trials of a design without a car's
name are of one car. Raises FoldcarError.
"""

import json
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from foldcar.errors import FoldcarError
from foldcar.inference.calibration.drive_features import (
    ENDS,
    FEATURES,
    LEAST_RAD,
    PASSED,
    PITCH,
    ROLL,
    TIME,
    drive_end,
    magnitude,
    path_features,
    possible_ends,
    told_features,
)
from foldcar.inference.calibration.experiment import SweptExperiment
from foldcar.inference.calibration.parameters import FloatArray
from foldcar.inference.calibration.posterior import IntArray
from foldcar.link.log_features import log_features
from foldcar.link.tlog import log_damage
from foldcar.store.log_files import intact_log
from foldcar.store.reader import Store
from foldcar.store.trial_paths import trial_rows
from foldcar.store.trial_records import BUILT, SIMULATED, UNKNOWN, WITHDRAWN, Trial

# What of a trial counts: whether it passed; also its time; also its path and how it failed.
OUTCOMES, TIMES, PATHS = EVIDENCE = ("outcomes", "times", "paths")
ABORTED, ELSEWHERE, NO_DESIGN = "aborted", "elsewhere", "no design"
_WHY = {
    SIMULATED: "of simulated cars",
    BUILT: "of built cars",
    UNKNOWN: "of cars that may be built or simulated (tell with `foldcar trials correct` and --car)",
    WITHDRAWN: "withdrawn",
    ABORTED: "aborted",
    ELSEWHERE: "in another environment than the experiment's",
    NO_DESIGN: "of cars that are no designs of the experiment as swept",
}

BoolArray = np.ndarray[Any, np.dtype[np.bool_]]


@dataclass(frozen=True, slots=True)
class Cell:
    """A design by its index, and a scene of docs/carsim.md, None for any of the experiment's."""

    design: int
    scene: Mapping[str, Any] | None


@dataclass(frozen=True)
class Observations:
    """Trials: ``cell``, ``car`` (trials,) indices, ``ends`` (trials, ENDS) possible, ``features`` (trials, FEATURES).

    ``errors`` (trials, FEATURES) are standard deviations of what was measured. ``car_design`` (cars,) is the index of
    each car's design; ``notes`` are for the reader. ``from_sheets``: all cars were built from the sheets.
    """

    cells: tuple[Cell, ...]
    cell: IntArray
    car: IntArray
    car_design: IntArray
    ends: BoolArray
    features: FloatArray
    errors: FloatArray
    simulated: bool
    notes: tuple[str, ...]
    from_sheets: bool = False

    @property
    def passed(self) -> FloatArray:
        """1 for each trial (trials,) that passed, else 0."""
        return np.asarray(self.ends[:, 0], dtype=float)

    @property
    def design(self) -> IntArray:
        """The design of each trial (trials,), as an index of the experiment's."""
        return self.car_design[self.car]

    def counts(self) -> dict[int, tuple[int, int]]:
        """How many of how many trials passed, by the design's index, in ascending order."""
        passed = self.passed
        return {
            int(one): (int(passed[self.design == one].sum()), int((self.design == one).sum()))
            for one in np.unique(self.design)
        }

    def without(self, design: int) -> "Observations":
        """The trials of the other designs."""
        kept = self.design != design
        parts = ("cell", "car", "ends", "features", "errors")
        return replace(self, **{name: getattr(self, name)[kept] for name in parts})


def experiment_with_trials(store: Store, named: str | None) -> str:
    """The experiment that is named, or the only one with trials. Raises FoldcarError."""
    tried = list(dict.fromkeys(trial.experiment for trial in store.trials()))
    if not tried:
        raise FoldcarError(
            f"{store.path}: holds no trials: drive some (`foldcar log`) or import them (`foldcar trials import`)"
        )
    return _only(tried, named, f"{store.path}: has no trials of experiment", f"{store.path}: has trials of experiments")


def experiment_to_measure(store: Store, named: str | None) -> str:
    """The experiment that is named, or the only one, of those that were swept or have trials. Raises FoldcarError."""
    swept = [info.listed_id for info in store.info().experiments.values()] if store.holds_study() else []
    known = list(dict.fromkeys([*swept, *(trial.experiment for trial in store.trials())]))
    return _only(known, named, f"{store.path}: has no experiment", f"{store.path}: has experiments")


def _only(known: list[str], named: str | None, unknown: str, several: str) -> str:
    if named is None and len(known) > 1:
        raise FoldcarError(f"{several} {', '.join(known)}: choose one with --experiment")
    if named is None and known:
        return known[0]
    if named not in known:
        raise FoldcarError(f'{unknown} "{named or ""}"; it has {", ".join(known) or "none"}')
    return named


def observe(store: Store, experiment: SweptExperiment, simulated: bool, evidence: str = PATHS) -> Observations:
    """The trials of built cars, or, if ``simulated``, of simulated ones instead; ``evidence`` is one of EVIDENCE."""
    name = experiment.info.id
    elsewhere, here = store.trials_elsewhere(experiment.info), store.trials_here(experiment.info)
    kept: list[tuple[Trial, int]] = []
    left_out = Counter[str]()
    for trial in store.trials(name):
        design = experiment.design_of(trial.design) if trial.vehicle_type == experiment.info.vehicle_type else None
        if trial.standing != (SIMULATED if simulated else BUILT):
            left_out[trial.standing] += 1
        elif not trial.completed:
            left_out[ABORTED] += 1
        elif trial.id in elsewhere:
            left_out[ELSEWHERE] += 1
        elif design is None:
            left_out[NO_DESIGN] += 1
        else:
            kept.append((trial, design))
    reasons = "; ".join(f"{left_out[why]} {_WHY[why]}" for why in _WHY if left_out[why])
    if not kept:
        hint = " (--simulated-trials calibrates by them)" if left_out[SIMULATED] else ""
        raise FoldcarError(f"{store.path}: experiment {name}: no trial to calibrate by: {reasons}{hint}")
    notes = [f"Trials left out: {reasons}."] if reasons else []
    result = _observed(store, experiment, kept, here, evidence)
    notes += [*result.notes, *_notes(result, simulated)]
    # A car that `foldcar log` drove has told the hash of its design; how others were built is not known. The realities of
    # simulated cars are any.
    from_sheets = not simulated and all(trial.source is None and trial.design_hash for trial, _ in kept)
    return replace(result, simulated=simulated, notes=tuple(notes), from_sheets=from_sheets)


def _observed(
    store: Store, experiment: SweptExperiment, trials: Sequence[tuple[Trial, int]], here: set[int], evidence: str
) -> Observations:
    cells: dict[tuple[int, str | None], int] = {}
    cars: dict[tuple[int, str | None], int] = {}
    cell, car, ends, features, errors = [], [], [], [], []
    unused: list[str] = []
    for trial, design in trials:
        drive = store.trial_drive(trial.id) if trial.id in here else None
        scene = drive[2] if drive is not None else _sampled(experiment, trial, here)
        cell.append(cells.setdefault((design, scene), len(cells)))
        car.append(cars.setdefault((design, trial.car_name), len(cars)))
        passed = trial.outcome == PASSED
        errors.append(np.zeros(FEATURES))
        rows = None if evidence != PATHS or scene is None else trial_rows(store, trial)
        if rows is None:
            features.append(told_features(trial.elapsed_time_s if evidence != OUTCOMES else None, passed))
            if evidence == PATHS and trial.log is not None:
                try:
                    log = intact_log(store.path, trial.id, trial.log, trial.log_sha256)
                    errors[-1] = _felt(log, features[-1])
                    if log is not None and (damage := log_damage(log)):
                        unused.append(f"{damage}.")
                except FoldcarError as error:
                    unused.append(f"Not used: {error}.")
            how = trial.outcome if evidence == PATHS or passed else "not_passed"
            ends.append(possible_ends(how))
        else:
            features.append(path_features(rows, json.loads(scene or "")))
            # The parts of the way have their times.
            features[-1][TIME] = np.nan
            ends.append(np.arange(ENDS) == drive_end(trial.outcome, features[-1]))
    return Observations(
        tuple(Cell(design, None if scene is None else json.loads(scene)) for design, scene in cells),
        np.array(cell),
        np.array(car),
        np.array([design for design, _ in cars]),
        np.array(ends),
        np.array(features),
        np.array(errors),
        False,
        tuple(unused),
    )


def _felt(log: Path | None, features: FloatArray) -> FloatArray:
    """Adds to ``features`` what a built car felt by its log; returns the errors (FEATURES,). Raises FoldcarError."""
    errors = np.zeros(FEATURES)
    if log is None:
        return errors
    felt = log_features(log)
    for column, angle_rad in ((PITCH, felt.max_pitch_rad), (ROLL, felt.max_roll_rad)):
        if angle_rad is not None and felt.tilt_error_rad is not None:
            features[column] = magnitude(abs(angle_rad))
            errors[column] = felt.tilt_error_rad / (abs(angle_rad) + LEAST_RAD)
    return errors


def _sampled(experiment: SweptExperiment, trial: Trial, here: set[int]) -> str | None:
    """The scene of an imported trial's sample, if it is one of the experiment's."""
    known = trial.id in here and trial.sample is not None and trial.sample < len(experiment.scenes)
    return json.dumps(experiment.scenes[trial.sample or 0]) if known else None


def _notes(found: Observations, simulated: bool) -> list[str]:
    counts = found.counts()
    passed, counted = int(found.passed.sum()), len(found.passed)
    notes = []
    if simulated:
        notes.append("These are trials of SIMULATED cars: the calibration says nothing about built ones.")
    if len(counts) == 1:
        notes.append("All trials are of one design: one rate cannot tell parameters apart.")
    if passed in (0, counted):
        all_or_none = "All" if passed else "None"
        notes.append(f"{all_or_none} of the {counted} trials passed: they bound the parameters on one side only.")
    return notes
