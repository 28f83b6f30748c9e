"""Simulates several cars of a driven design in its trials' environments: how much they differ, and how hard these are.

Input: a store. Output: which cars passed, by the simulator that made the store's runs; nothing is stored. What could not
be compared with the runs is not simulated: another build of carsim, a calibration, a program that runs beside the car.
"""

import json
from collections.abc import Container, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy
from numpy.typing import NDArray

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

# Cars of a driven design, each simulated in as many environments: those of its trials, and others if these are few.
# Beyond MOST_CAR_RUNS, some twenty seconds, a design's cars are not simulated.
CARS, LEAST_SCENES, MOST_SCENES, MOST_CAR_RUNS = 20, 10, 12, 5_000
# Which cars passed in a scene, by build, engine, body, settings, cars and scene. It outlives a store: the live page reads
# its own anew after every trial.
_PASSED: dict[tuple[Any, ...], list[bool]] = {}


@dataclass(frozen=True)
class SimulatedCars:
    """Simulated cars of one design: whether each ``passed`` (cars, scenes).

    ``shares``: how many of them, 0 to 1, passed in the scene of a trial, by its number.
    """

    passed: NDArray[Any]
    shares: Mapping[int, float]


class Resimulation:
    """Runs of one store that are made now. The simulator is looked for when it is first needed."""

    def __init__(self, store: Store) -> None:
        self._store = store
        self._car_runs = 0

    def cars(self, info: ExperimentInfo, trials: Sequence[Trial], here: Container[int]) -> SimulatedCars | None:
        """Cars of one design, as the experiment varies them, in the environments of its ``trials``; None if unknown.

        ``here`` are the trials whose sample is the sweep's.
        """
        drives = self._store.once(("drives", info.id), lambda: read_drives(self._store, info.id))
        design = dict(trials[0].design)
        if design not in drives.parameters or not self._is_comparable(info, drives):
            return None
        stored = self._store.once(("scenes", info.id), lambda: _scenes(drives))
        placed = {}
        for trial in trials:
            drive = self._store.trial_drive(trial.id)
            if drive is not None:
                placed[trial.id] = drive[2]
            elif trial.id in here and trial.sample in stored:
                placed[trial.id] = stored[trial.sample]
        scenes = list(dict.fromkeys(placed.values()))[:MOST_SCENES]
        others = [text for text in stored.values() if text not in scenes]
        scenes += others[: max(0, LEAST_SCENES - len(scenes))]
        at = drives.parameters.index(design)
        body, settings = drives.text("body", drives.bodies[at]), drives.text("settings", drives.settings[at])
        cars = [drives.value("variation", drives.variations[sample]) for sample in sorted(drives.variations)[:CARS]]
        known_by = (info.carsim_build, info.engine, body, settings, json.dumps(cars))
        new = [text for text in scenes if (known_by, text) not in _PASSED]
        self._car_runs += len(cars) * len(new)
        if self._car_runs > MOST_CAR_RUNS:
            return None
        if new:
            for text, passed in zip(new, _simulated(self._simulator(info), body, settings, cars, new), strict=True):
                _PASSED[known_by, text] = passed
        table = numpy.array([_PASSED[known_by, text] for text in scenes]).T
        shares = dict(zip(scenes, table.mean(axis=0).tolist(), strict=True))
        return SimulatedCars(table, {number: shares[text] for number, text in placed.items() if text in shares})

    def _is_comparable(self, info: ExperimentInfo, drives: StoredDrives) -> bool:
        if info.under is not None or drives.dynamic or not drives.varied:
            return False
        try:
            return self._simulator(info).build == info.carsim_build
        except FoldcarError:
            return False

    def _simulator(self, info: ExperimentInfo) -> Carsim:
        return self._store.once(("carsim", info.engine), lambda: Carsim(engine=engine_of(info.engine)))


def _scenes(drives: StoredDrives) -> dict[int, str]:
    """The texts of the scenes that the sweep has stored, by sample."""
    return {sample: drives.text("scene", one) for sample, one in drives.scenes.items()}


def _simulated(
    carsim: Carsim, body: str, settings: str, cars: Sequence[Mapping[str, Any]], scenes: Sequence[str]
) -> list[list[bool]]:
    """Whether the body, varied as each of the cars, passes in each scene: for each scene, by car."""
    limits = carsim.limits().numbers
    bodies = {str(at): canonical_json(vary_body(json.loads(body), car, limits)) for at, car in enumerate(cars)}
    named = {str(at): scene for at, scene in enumerate(scenes)}
    cases = [(car, scene) for scene in named for car in bodies]
    requests = [
        RunRequest(car, scene, settings, f"environment {number}", number) for number, (car, scene) in enumerate(cases)
    ]
    passed = [outcome_of(answer) == "passed" for answer in carsim.run(bodies, named, requests)]
    return [passed[at : at + len(cars)] for at in range(0, len(passed), len(cars))]
