"""A swept experiment of a store as a calibration takes it: its designs and scenes, runs of them, its trials.

Input: a store and the name of an experiment. Output: a SweptExperiment, without listing and program; whether runs under
changed parameters pass, in order, the same for any number of processes; trials counted by design. FoldcarError.
"""

import json
from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property, partial
from itertools import islice
from typing import Any

from foldcar.calibration.effects import calibrated_scene, calibrated_variation
from foldcar.car.variation import vary_body
from foldcar.errors import FoldcarError
from foldcar.simulation.carsim import Carsim
from foldcar.simulation.results import outcome_of
from foldcar.simulation.runner import RunRequest, side_by_side
from foldcar.store.info import ExperimentInfo
from foldcar.store.reader import Store
from foldcar.store.rows import parsed
from foldcar.store.tables import BY_NAME, DESIGN, ENVIRONMENT, EXPERIMENT
from foldcar.store.trial_records import BUILT, SIMULATED, UNKNOWN, WITHDRAWN
from foldcar.store.writer import canonical_json

# Fewer scenes are no sample of an environment.
LEAST_SCENES = 20
CHUNK_RUNS = 60
# A parameter set whose runs the simulator cannot compute is left out, but only in rare cases.
MOST_FAILED = 0.02
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
class SweptDesign:
    """A design by its parameters (``width_mm``, …), with its body and settings as in docs/carsim.md."""

    parameters: Mapping[str, float]
    body: Mapping[str, Any]
    settings: str


@dataclass(frozen=True)
class SweptExperiment:
    """``designs`` and ``scenes`` in the store's order; ``info`` as the store has it."""

    info: ExperimentInfo
    designs: tuple[SweptDesign, ...]
    scenes: tuple[Mapping[str, Any], ...]

    def design_of(self, parameters: Mapping[str, float]) -> int | None:
        """The index of the design with these parameters; None if it has none such."""
        return self._indices.get(frozenset(parameters.items()))

    @cached_property
    def _indices(self) -> dict[frozenset[tuple[str, float]], int]:
        return {frozenset(design.parameters.items()): i for i, design in enumerate(self.designs)}


def read_experiment(store: Store, name: str) -> SweptExperiment:
    """The experiment ``name`` of ``store``. FoldcarError."""
    place = f"{store.path}: experiment {name}"
    known = store.info().experiments
    if name not in known:
        swept = ", ".join(known)
        raise FoldcarError(f"{place}: was not swept into this store, which has {swept}: sweep its listing first")
    info = known[name]
    if info.calibration is not None:
        listed = info.calibration["experiment"]
        raise FoldcarError(f"{place}: was swept under {info.under}: calibrate by experiment {listed} instead")
    if not info.success_defined:
        raise FoldcarError(f"{place}: {info.success_rule}")
    (row,) = store.rows(EXPERIMENT, "WHERE id = ?", name)
    (environment,) = store.rows(ENVIRONMENT, "WHERE id = ?", row["environment_id"])
    if environment["dynamic"]:
        raise FoldcarError(
            f"{place}: {info.scenic_program} runs beside the simulation, whose scenes cannot be changed; calibrate in an "
            "environment whose program only places things"
        )
    scenes = [
        _json(store, "scene", one["scene_id"])
        for one in store.rows(BY_NAME["sample"], "WHERE environment_id = ? ORDER BY sample", environment["id"])
    ]
    if len(scenes) < LEAST_SCENES:
        raise FoldcarError(
            f"{place}: the store has {len(scenes)} scenes of its environment, a calibration needs {LEAST_SCENES}: "
            f"sweep with --environments {LEAST_SCENES} or more"
        )
    designs = [
        SweptDesign(
            parsed(store.path, DESIGN, one, "parameters"),
            _json(store, "body", one["body_id"]),
            json.dumps(_json(store, "settings", one["settings_id"])),
        )
        for one in store.rows(DESIGN, "WHERE experiment = ? ORDER BY position", name)
    ]
    return SweptExperiment(info, tuple(designs), tuple(scenes))


def _json(store: Store, table: str, number: int) -> dict[str, Any]:
    for row in store.rows(BY_NAME[table], "WHERE id = ?", number):
        found: dict[str, Any] = parsed(store.path, BY_NAME[table], row, "json")
        return found
    raise FoldcarError(f"{store.path}: {table} (id={number}) is missing; `foldcar check` names all that is")


@dataclass(frozen=True, slots=True)
class CalibrationRun:
    """A design by its index, under ``values``, in the scene of that index; ``number`` chooses what scatters."""

    design: int
    values: Mapping[str, float]
    scene: int
    number: int


class Simulator:
    """Simulates runs of one experiment. ``seed`` is that of everything that scatters."""

    def __init__(self, experiment: SweptExperiment, carsim: Carsim, jobs: int, seed: int) -> None:
        self.experiment = experiment
        self.seed = seed
        self._carsim = carsim
        self._limits = carsim.limits().numbers
        self._jobs = jobs

    def passed(
        self, runs: Iterable[CalibrationRun], done: Callable[[int], None] = lambda runs: None
    ) -> list[bool | None]:
        """Whether each run passed, None if it failed; ``done`` is told of finished runs. FoldcarError."""
        left = iter(runs)
        results: list[bool | None] = []
        chunks = iter(lambda: list(islice(left, CHUNK_RUNS)), [])
        calls = (partial(self._run, *self._inputs(chunk)) for chunk in chunks)
        for finished in side_by_side(calls, self._jobs, self._carsim.stop):
            results += finished
            done(len(finished))
        failed = results.count(None)
        if failed > MOST_FAILED * len(results):
            raise FoldcarError(
                f"experiment {self.experiment.info.id}: {failed} of {len(results)} simulations with changed parameters "
                "failed"
            )
        return results

    def _inputs(self, chunk: list[CalibrationRun]) -> tuple[dict[str, str], dict[str, str], list[RunRequest]]:
        bodies, scenes, requests = {}, {}, []
        for name, run in zip(map(str, range(len(chunk))), chunk, strict=True):
            design, scene = self.experiment.designs[run.design], self.experiment.scenes[run.scene]
            variation = calibrated_variation(run.values, self.experiment.info.variation, self.seed, run.number)
            bodies[name] = canonical_json(vary_body(design.body, variation, self._limits))
            scenes[name] = canonical_json(calibrated_scene(scene, run.values, self.seed, run.number))
            label = f"design {run.design + 1}, sample {run.scene}"
            requests.append(RunRequest(name, name, design.settings, label, run.scene))
        return bodies, scenes, requests

    def _run(self, bodies: dict[str, str], scenes: dict[str, str], requests: list[RunRequest]) -> list[bool | None]:
        outcomes = map(outcome_of, self._carsim.run(bodies, scenes, requests))
        return [None if outcome == "failed" else outcome == "passed" for outcome in outcomes]


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
        if trial.standing != (SIMULATED if simulated else BUILT):
            left_out[trial.standing] += 1
        elif not trial.completed:
            left_out[ABORTED] += 1
        elif trial.id in elsewhere:
            left_out[ELSEWHERE] += 1
        elif design is None:
            left_out[NO_DESIGN] += 1
        else:
            counted[design] += 1
            passed[design] += trial.outcome == "passed"
    reasons = "; ".join(f"{left_out[why]} {_WHY[why]}" for why in _WHY if left_out[why])
    if not counted:
        hint = " (--simulated-trials calibrates by them)" if left_out[SIMULATED] else ""
        raise FoldcarError(f"{store.path}: experiment {name}: no trial to calibrate by: {reasons}{hint}")
    notes = [f"Trials left out: {reasons}."] if reasons else []
    if simulated:
        notes.append("These are trials of SIMULATED cars: the calibration says nothing about built ones.")
    if len(counted) == 1:
        notes.append("All trials are of one design: one rate cannot tell parameters apart.")
    if passed.total() in (0, counted.total()):
        all_or_none = "All" if passed.total() else "None"
        notes.append(f"{all_or_none} of the {counted.total()} trials passed: they bound the parameters on one side only.")
    designs = tuple(sorted(counted))
    passes, trials = (tuple(one[design] for design in designs) for one in (passed, counted))
    return TrialCounts(designs, passes, trials, simulated, tuple(notes))
