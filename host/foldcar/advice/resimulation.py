"""Simulates what a sweep lacks: trials as they were placed, and designs that only trials have.

Input: a store. Output: outcomes, from the simulator that made the store's runs; nothing is stored. What would not be
comparable with the runs is not simulated: another build of carsim, a calibration, a program that runs beside the car.
"""

import json
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

from foldcar.analysis.words import count
from foldcar.car.body import body_json
from foldcar.car.design import compose, parameters
from foldcar.car.folded_car import folded_car
from foldcar.car.variation import vary_body
from foldcar.errors import FoldcarError
from foldcar.simulation.carsim import Carsim
from foldcar.simulation.engines import engine_of
from foldcar.simulation.results import outcome_of
from foldcar.simulation.runner import RunRequest
from foldcar.store.info import ExperimentInfo
from foldcar.store.reader import Store
from foldcar.store.stored_drives import StoredDrives, read_drives
from foldcar.store.trial_records import Trial
from foldcar.store.writer import canonical_json
from foldcar.study.experiments import run_settings

# Runs of designs, beyond those of the first, and trials that one command simulates: some twenty seconds each.
MOST_RUNS, MOST_TRIALS = 5_000, 2_000

# An outcome, and the time of the run (s), None if it failed.
Ended = tuple[str, float | None]


class Resimulation:
    """Runs of one store that are made now. The simulator is looked for when it is first needed."""

    def __init__(self, store: Store) -> None:
        self._store = store
        self._refusals: dict[str, str | None] = {}
        self._refused: Counter[str] = Counter()
        self._beyond: Counter[str] = Counter()
        self._runs = self._trials = 0

    def trial(self, info: ExperimentInfo, trial: Trial) -> str | None:
        """The outcome of a trial's car in the scene as placed, varied as the run of that sample; None if unknown."""
        drive = self._store.trial_drive(trial.id)
        if drive is None:
            return None
        if self._refusal(info) is not None:
            self._refused[info.id] += 1
            return None
        if self._trials >= MOST_TRIALS:
            self._beyond[info.id] += 1
            return None
        self._trials += 1
        body, settings, scene = drive
        case = self._variation(info, trial.sample), scene
        ((outcome, _),) = self._run(self._simulator(info), body, [case], settings)
        return outcome

    def design(self, info: ExperimentInfo, trial: Trial) -> tuple[list[Ended], str | None]:
        """The design of a trial in all stored environments of the experiment, in order; else none, and why."""
        refusal = self._refusal(info)
        if refusal is not None:
            return [], refusal
        scenes = self._scenes(info)
        if self._runs and self._runs + len(scenes) > MOST_RUNS:
            return [], f"no more than {MOST_RUNS:,} runs are made at a time; sweep it"
        self._runs += len(scenes)
        columns = {parameter.column: key for key, parameter in parameters().items()}
        carsim, place = self._simulator(info), f"{self._store.path}: experiment {info.id}"
        try:
            design = compose(trial.vehicle_type, {columns[name]: value for name, value in trial.design.items()})
            folded_car(design)
            body = body_json(design)
            table = carsim.parameter_table()
            settings = run_settings(design, body, table, info.timeout_s, info.speed_m_s, info.yaw_rate_rad_s, place)
        except KeyError as error:
            return [], f"no module has the parameter {error.args[0]}"
        except FoldcarError as error:
            return [], str(error).rstrip(".")
        cases = [(self._variation(info, sample), text) for sample, text in scenes.items()]
        return self._run(carsim, canonical_json(body), cases, canonical_json(settings)), None

    def remarks(self, experiment: str) -> list[str]:
        """What is said of trials of that experiment that should have been simulated and were not."""
        why = {f"no more than {MOST_TRIALS:,} are at a time": self._beyond[experiment]}
        why[str(self._refusals.get(experiment))] = self._refused[experiment]
        return [f"{count(number, 'trial')} not simulated as placed: {text}." for text, number in why.items() if number]

    def _refusal(self, info: ExperimentInfo) -> str | None:
        if info.id not in self._refusals:
            self._refusals[info.id] = self._why_not(info)
        return self._refusals[info.id]

    def _why_not(self, info: ExperimentInfo) -> str | None:
        if info.under is not None:
            return f"the runs are those of {info.under}"
        if self._drives(info).dynamic:
            return f"{info.scenic_program} runs beside the simulation"
        try:
            build = self._simulator(info).build
        except FoldcarError as error:
            return str(error)
        if build == info.carsim_build:
            return None
        return f"the runs are of carsim {info.carsim_build[:12]}, this one is {build[:12]}; sweep again"

    def _simulator(self, info: ExperimentInfo) -> Carsim:
        return self._store.once(("carsim", info.engine), lambda: Carsim(engine=engine_of(info.engine)))

    def _run(
        self, carsim: Carsim, body: str, cases: Sequence[tuple[Mapping[str, Any], str]], settings: str
    ) -> list[Ended]:
        """The body in each case, which is a variation and a scene."""
        cars, scenes, requests = {}, {}, []
        for number, (variation, scene) in enumerate(cases):
            name, limits = str(number), carsim.limits().numbers
            cars[name] = canonical_json(vary_body(json.loads(body), variation, limits)) if variation else body
            scenes[name] = scene
            requests.append(RunRequest(name, name, settings, f"environment {number}", number))
        answers = carsim.run(cars, scenes, requests)
        return [(outcome_of(answer), answer.get("elapsed_time_s")) for answer in answers]

    def _drives(self, info: ExperimentInfo) -> StoredDrives:
        return self._store.once(("drives", info.id), lambda: read_drives(self._store, info.id))

    def _scenes(self, info: ExperimentInfo) -> dict[int, str]:
        """The texts of the scenes that the sweep has stored, by sample."""
        drives = self._drives(info)
        read = lambda: {sample: drives.text("scene", one) for sample, one in drives.scenes.items()}  # noqa: E731
        return self._store.once(("scenes", info.id), read)

    def _variation(self, info: ExperimentInfo, sample: int | None) -> Mapping[str, Any]:
        """How the car of that sample differs from its design."""
        drives = self._drives(info)
        known = info.variation and sample in drives.variations
        return drives.value("variation", drives.variations[sample]) if known and sample is not None else {}
