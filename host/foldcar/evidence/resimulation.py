"""Simulate what a sweep lacks: trials as they were placed, designs with trials only.

Input: a store. Output: outcomes, from the simulator that made the store's runs; nothing is stored. Nothing is simulated
if it would not be comparable with the runs: with another build of carsim, in a reality, or if the Scenic program
runs beside the simulation.
"""

import hashlib
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from foldcar.car.body import body_json
from foldcar.car.design import compose_columns
from foldcar.car.folded_car import folded_car
from foldcar.errors import FoldcarError
from foldcar.simulation.carsim import Carsim
from foldcar.simulation.engines import engine_of
from foldcar.simulation.results import outcome_of
from foldcar.simulation.runner import RunRequest
from foldcar.statistics.words import count
from foldcar.store.info import ExperimentInfo
from foldcar.store.reader import Store
from foldcar.store.stored_drives import read_drives
from foldcar.store.trial_records import Trial
from foldcar.store.writer import canonical_json
from foldcar.study.experiments import run_settings

# Limits for one command, about twenty seconds each: runs of designs that were not swept (the first of these designs is
# always simulated), and trials that are simulated as placed.
MAX_RUNS, MAX_TRIALS = 5_000, 2_000
# The outcome and the time of a run (s), None if it failed.
RunResult = tuple[str, float | None]
# Results by a hash of build, engine, body, settings and scene. They outlive a store, because `foldcar.Study` opens it
# anew for each question.
_RESULTS: dict[bytes, RunResult] = {}


class Case(NamedTuple):
    """What distinguishes the runs of one car: how it differs from its design, and the scene as JSON text."""

    variation: Mapping[str, Any]
    scene: str


class Resimulation:
    """New runs for one store; the simulator is started when it is first needed."""

    def __init__(self, store: Store) -> None:
        self._store = store
        self._refusals: dict[str, str | None] = {}
        self._refused: Counter[str] = Counter()
        self._over_limit: Counter[str] = Counter()
        self._runs = self._trials = 0

    def trial(self, info: ExperimentInfo, trial: Trial) -> str | None:
        """Simulate what a trial drove, with the obstacles where they really stood, and return the outcome.

        The simulated car deviates from its design as in the swept run of the same sample. Returns None if the store lacks
        what the trial drove, if the runs of the experiment cannot be repeated here, or after MAX_TRIALS trials. The
        trials of the last two cases are counted, so that a remark can say how many they are.
        """
        drive = self._store.trial_drive(trial.id)
        if drive is None:
            return None
        if self._refusal(info) is not None:
            self._refused[info.id] += 1
            return None
        if self._trials >= MAX_TRIALS:
            self._over_limit[info.id] += 1
            return None
        self._trials += 1
        case = Case(self._variation(info, trial.sample), drive.scene)
        results = self._run(self._simulator(info), drive.body, [case], drive.settings)
        outcome, _ = results[0]
        return outcome

    def design(self, info: ExperimentInfo, trial: Trial) -> tuple[list[RunResult], str | None]:
        """Simulate the design of a trial in each stored environment of the experiment.

        Returns the results in the order of the environments and None, or an empty list and the reason why the design
        cannot be simulated.
        """
        refusal = self._refusal(info)
        if refusal is not None:
            return [], refusal
        scenes = self._scenes(info)
        # The limit does not stop the first design.
        is_first_design = self._runs == 0
        if not is_first_design and self._runs + len(scenes) > MAX_RUNS:
            return [], f"no more than {MAX_RUNS:,} runs are made at a time; sweep it"
        self._runs += len(scenes)
        try:
            body, settings = self._composed(info, trial)
        except FoldcarError as error:
            return [], str(error).rstrip(".")
        cases = [Case(self._variation(info, sample), scene) for sample, scene in scenes.items()]
        return self._run(self._simulator(info), body, cases, settings), None

    def _composed(self, info: ExperimentInfo, trial: Trial) -> tuple[str, str]:
        """Return the simulated body and the settings of a trial's design, as JSON texts.

        Raises FoldcarError if the car cannot be built.
        """
        design = compose_columns(trial.vehicle_type, trial.design)
        # Raises DesignError if the car cannot be folded.
        folded_car(design)
        body = body_json(design)
        parameters = self._simulator(info).parameter_table()
        place = f"{self._store.path}: experiment {info.id}"
        settings = run_settings(design, body, parameters, info.timeout_s, info.speed_m_s, info.yaw_rate_rad_s, place)
        return canonical_json(body), canonical_json(settings)

    def remarks(self, experiment: str) -> list[str]:
        """Return remarks on trials of an experiment that could not be simulated as placed."""
        sentences = []
        over_limit, refused = self._over_limit[experiment], self._refused[experiment]
        if over_limit:
            reason = f"no more than {MAX_TRIALS:,} are simulated at a time"
            sentences.append(f"{count(over_limit, 'trial')} not simulated as placed: {reason}.")
        if refused:
            sentences.append(f"{count(refused, 'trial')} not simulated as placed: {self._refusals[experiment]}.")
        return sentences

    def _refusal(self, info: ExperimentInfo) -> str | None:
        """Return the reason why an experiment's runs cannot be repeated now, or None if they can. It is found once."""
        if info.id not in self._refusals:
            self._refusals[info.id] = self._why_not_repeatable(info)
        return self._refusals[info.id]

    def _why_not_repeatable(self, info: ExperimentInfo) -> str | None:
        """Return the reason why an experiment's runs cannot be repeated with this simulator, or None if they can."""
        # ``under`` names the values of the simulator's uncertain parameters, unless the runs have their nominal values.
        if info.under is not None:
            return f"the runs are those of {info.under}"
        if read_drives(self._store, info.id).dynamic:
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

    def _run(self, carsim: Carsim, body: str, cases: Sequence[Case], settings: str) -> list[RunResult]:
        """Simulate a car in each of the cases and return the results in their order.

        ``body`` and ``settings`` are JSON texts. Results of earlier runs are reused.
        """
        keys = []
        scene_by_name, requests = {}, []
        # The keys of the cases that were not simulated earlier, in the order of the requests.
        new_keys = []
        for index, case in enumerate(cases):
            reality = canonical_json(case.variation)
            inputs = [carsim.build, body, reality, settings, case.scene]
            key = hashlib.sha256("\0".join(inputs).encode()).digest()
            keys.append(key)
            if key not in _RESULTS:
                new_keys.append(key)
                scene_name = str(index)
                scene_by_name[scene_name] = case.scene
                label = f"environment {index}"
                requests.append(RunRequest("car", scene_name, settings, label, sample=index, reality=reality))
        answers = carsim.run({"car": body}, scene_by_name, requests) if requests else []
        for key, answer in zip(new_keys, answers, strict=True):
            _RESULTS[key] = outcome_of(answer), answer.get("elapsed_time_s")
        return [_RESULTS[key] for key in keys]

    def _scenes(self, info: ExperimentInfo) -> dict[int, str]:
        """Return the stored scenes as JSON, by sample."""
        drives = read_drives(self._store, info.id)
        return self._store.once(
            ("scenes", info.id),
            lambda: {sample: drives.text("scene", scene) for sample, scene in drives.scenes.items()},
        )

    def _variation(self, info: ExperimentInfo, sample: int | None) -> Mapping[str, Any]:
        """Return how the car of a sample differs from its design; empty if the experiment does not vary its cars."""
        drives = read_drives(self._store, info.id)
        if not info.variation or sample is None or sample not in drives.variations:
            return {}
        return drives.value("variation", drives.variations[sample])
