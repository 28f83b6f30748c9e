"""The trials that a calibration goes by, counted by design; what is left out, and why, in words.

Input: a store and a swept experiment of it. Output: TrialCounts. FoldcarError, as one sentence, if nothing is left.
"""

from collections import Counter
from dataclasses import dataclass

from foldcar.calibration.experiment import SweptExperiment
from foldcar.errors import FoldcarError
from foldcar.store.reader import Store
from foldcar.store.trial_records import BUILT, SIMULATED, UNKNOWN, WITHDRAWN, Trial

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


@dataclass(frozen=True, slots=True)
class TrialCounts:
    """``passed`` of ``counted`` trials for each of ``designs``, indices of the experiment's; ``notes`` for the reader."""

    designs: tuple[int, ...]
    passed: tuple[int, ...]
    counted: tuple[int, ...]
    simulated: bool
    notes: tuple[str, ...]


def experiment_with_trials(store: Store, named: str | None) -> str:
    """The experiment that is named, or the only one with trials. FoldcarError."""
    there = list(dict.fromkeys(trial.experiment for trial in store.trials()))
    if not there:
        raise FoldcarError(
            f"{store.path}: holds no trials: drive some (`foldcar log`) or import them (`foldcar trials import`)"
        )
    if named is not None and named not in there:
        raise FoldcarError(f'{store.path}: has no trials of experiment "{named}", only of {", ".join(there)}')
    if named is None and len(there) > 1:
        raise FoldcarError(f"{store.path}: has trials of experiments {', '.join(there)}: choose one with --experiment")
    return named if named is not None else there[0]


def count_trials(store: Store, experiment: SweptExperiment, simulated: bool) -> TrialCounts:
    """Count the trials of built cars, or, if ``simulated``, those of simulated ones instead."""
    name = experiment.info.id
    elsewhere = store.trials_elsewhere(experiment.info)
    counted, passed, left_out = Counter[int](), Counter[int](), Counter[str]()
    for trial in store.trials(name):
        design = experiment.design_of(trial.design) if trial.vehicle_type == experiment.info.vehicle_type else None
        why = _why_not(trial, simulated, trial.id in elsewhere, design)
        if why or design is None:
            left_out[why or NO_DESIGN] += 1
        else:
            counted[design] += 1
            passed[design] += trial.outcome == "passed"
    reasons = "; ".join(f"{left_out[why]} {_WHY[why]}" for why in _WHY if left_out[why])
    if not counted:
        hint = " (--simulated-trials calibrates by them)" if left_out[SIMULATED] else ""
        raise FoldcarError(f"{store.path}: experiment {name}: no trial to calibrate by: {reasons}{hint}")
    designs = tuple(sorted(counted))
    notes = [f"Trials left out: {reasons}."] if reasons else []
    return TrialCounts(
        designs,
        tuple(passed[design] for design in designs),
        tuple(counted[design] for design in designs),
        simulated,
        (*notes, *_warnings(len(designs), passed.total(), counted.total(), simulated)),
    )


def _why_not(trial: Trial, simulated: bool, elsewhere: bool, design: int | None) -> str | None:
    if trial.standing != (SIMULATED if simulated else BUILT):
        return trial.standing
    if not trial.completed:
        return ABORTED
    if elsewhere:
        return ELSEWHERE
    return NO_DESIGN if design is None else None


def _warnings(designs: int, passed: int, counted: int, simulated: bool) -> list[str]:
    found = []
    if simulated:
        found.append("These are trials of SIMULATED cars: the calibration says nothing about built ones.")
    if designs == 1:
        found.append("All trials are of one design: one rate cannot tell parameters apart.")
    if passed in (0, counted):
        all_or_none = "All" if passed else "None"
        found.append(f"{all_or_none} of the {counted} trials passed: they bound the parameters on one side only.")
    return found
