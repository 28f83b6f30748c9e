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
from foldcar.store.tables import BY_NAME, EXPERIMENT
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
        variation = self._variations(info).get(trial.sample if trial.sample is not None else -1, {})
        ((outcome, _),) = self._run(self._simulator(info), body, [(variation, scene)], settings)
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
        variations = self._variations(info)
        cases = [(variations.get(sample, {}), text) for sample, text in scenes.items()]
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
        (environment,) = self._rows("environment", "WHERE id = ?", self._experiment(info)["environment_id"])
        if environment["dynamic"]:
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

    def _scenes(self, info: ExperimentInfo) -> dict[int, str]:
        """The texts of the scenes that the sweep has stored, by sample."""

        def read() -> dict[int, str]:
            where = "WHERE environment_id = ? AND sample < ? ORDER BY sample"
            rows = self._rows("sample", where, self._experiment(info)["environment_id"], info.environments)
            return {row["sample"]: self._text("scene", row["scene_id"]) for row in rows}

        return self._store.once(("scenes", info.id), read)

    def _variations(self, info: ExperimentInfo) -> dict[int, Mapping[str, Any]]:
        def read() -> dict[int, Mapping[str, Any]]:
            rows = self._rows("draw", "WHERE spread_id = ?", self._experiment(info)["spread_id"])
            return {row["sample"]: json.loads(self._text("variation", row["variation_id"])) for row in rows}

        return self._store.once(("variations", info.id), read) if info.variation else {}

    def _rows(self, table: str, where: str, *values: Any) -> list[dict[str, Any]]:
        return list(self._store.rows(BY_NAME[table], where, *values))

    def _text(self, table: str, number: int) -> str:
        (row,) = self._rows(table, "WHERE id = ?", number)
        return str(row["json"])

    def _experiment(self, info: ExperimentInfo) -> dict[str, Any]:
        (row,) = self._store.rows(EXPERIMENT, "WHERE id = ?", info.id)
        return row
