"""Reads a swept experiment's designs and scenes from a store, and simulates them with changed parameters.

Input: a store and the name of an experiment; neither listing nor Scenic program is needed. Output: a SweptExperiment, and
whether runs passed, the same for any number of processes. Raises FoldcarError.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property, partial
from itertools import islice
from typing import Any

import numpy as np

from foldcar.belief.priors import FloatArray
from foldcar.belief.reality import drawn_reality
from foldcar.errors import FoldcarError
from foldcar.simulation.carsim import Carsim
from foldcar.simulation.results import outcome_of
from foldcar.simulation.runner import RunRequest, side_by_side
from foldcar.store.info import ExperimentInfo
from foldcar.store.reader import Store
from foldcar.store.stored_drives import read_drives
from foldcar.store.writer import canonical_json

PASSED = "passed"
# Fewer scenes do not represent an environment.
MIN_SCENES = 20
CHUNK_RUNS = 60
# Failed simulations are left out if they are at most this fraction.
MAX_FAILED = 0.02


@dataclass(frozen=True, slots=True)
class SweptDesign:
    """A design by its parameters (``width_mm``, …), with its body and settings as in docs/carsim.md."""

    parameters: Mapping[str, float]
    body: Mapping[str, Any]
    settings: str


@dataclass(frozen=True)
class SweptExperiment:
    """A swept experiment: its stored description, its ``designs`` and ``scenes`` in the store's order."""

    info: ExperimentInfo
    designs: tuple[SweptDesign, ...]
    scenes: tuple[Mapping[str, Any], ...]

    def design_of(self, parameters: Mapping[str, float]) -> int | None:
        """Return the index of the design with these parameters; None if there is no such design."""
        return self._indices.get(frozenset(parameters.items()))

    def varied(self, design: int) -> dict[str, float]:
        """Return the parameters that vary over the family, for the design with this index."""
        return {name: float(self.designs[design].parameters[name]) for name in self.info.varied}

    @cached_property
    def _indices(self) -> dict[frozenset[tuple[str, float]], int]:
        """The designs' indices by their parameters."""
        return {frozenset(design.parameters.items()): i for i, design in enumerate(self.designs)}


def read_experiment(store: Store, name: str) -> SweptExperiment:
    """Read the designs and scenes of experiment ``name``. Raises FoldcarError if it cannot be calibrated."""
    place = f"{store.path}: experiment {name}"
    experiments = store.info().experiments
    if name not in experiments:
        swept = ", ".join(experiments)
        raise FoldcarError(f"{place}: was not swept into this store, which has {swept}: sweep its listing first")
    info = experiments[name]
    if info.calibration is not None:
        listed = info.calibration["experiment"]
        raise FoldcarError(f"{place}: was swept under {info.under}: calibrate by experiment {listed} instead")
    if not info.success_defined:
        raise FoldcarError(f"{place}: {info.success_rule}")
    drives = read_drives(store, name)
    if drives.dynamic:
        raise FoldcarError(
            f"{place}: {info.scenic_program} runs beside the simulation, whose scenes cannot be changed; calibrate in an "
            "environment whose program only places things"
        )
    scenes = [drives.value("scene", scene) for scene in drives.scenes.values()]
    if len(scenes) < MIN_SCENES:
        raise FoldcarError(
            f"{place}: the store has {len(scenes)} scenes of its environment, a calibration needs {MIN_SCENES}: "
            f"sweep with --samples {MIN_SCENES} or more"
        )
    designs = [
        SweptDesign(parameters, drives.value("body", body), drives.text("settings", settings))
        for parameters, body, settings in zip(drives.parameters, drives.bodies, drives.settings, strict=True)
    ]
    return SweptExperiment(info, tuple(designs), tuple(scenes))


def nominal_counts(store: Store, experiment: SweptExperiment) -> dict[int, tuple[int, int]]:
    """Return the pair (passed, counted) of numbers of nominal runs, by the design's index."""
    counts = store.design_counts(experiment.info.id)
    return dict(enumerate(zip(counts.passed, counts.counted, strict=True)))


@dataclass(frozen=True, slots=True)
class CalibrationRun:
    """A run of the design with index ``design`` in a scene, as in docs/carsim.md.

    ``values`` are the simulator's parameters by name. ``car`` is the seed of the car's differences from its design,
    ``number`` that of the drive's differences.
    """

    design: int
    values: Mapping[str, float]
    scene: Mapping[str, Any]
    car: int
    number: int


class Simulator:
    """Simulates runs of one experiment in ``jobs`` processes; ``seed`` belongs to all random differences."""

    def __init__(self, experiment: SweptExperiment, carsim: Carsim, jobs: int, seed: int) -> None:
        self.experiment = experiment
        self.seed = seed
        self._carsim = carsim
        self._jobs = jobs

    def passes(self, runs: Iterable[CalibrationRun], done: Callable[[int], None] = lambda runs: None) -> FloatArray:
        """Simulate the runs. Returns (runs,): 1 if the run passed, 0 if not, NaN if the simulation failed.

        ``done`` is called with numbers of finished runs. Raises FoldcarError if too many simulations fail.
        """
        remaining = iter(runs)
        # Lists of up to CHUNK_RUNS runs, until one is empty.
        chunks = iter(lambda: list(islice(remaining, CHUNK_RUNS)), [])
        results: list[float] = []
        for passed in side_by_side((partial(self._run, chunk) for chunk in chunks), self._jobs, self._carsim.stop):
            results += passed
            done(len(passed))
        failed = int(np.isnan(results).sum())
        if failed > MAX_FAILED * len(results):
            raise FoldcarError(
                f"experiment {self.experiment.info.id}: {failed} of {len(results)} simulations with changed parameters "
                "failed"
            )
        return np.array(results)

    def _run(self, chunk: list[CalibrationRun]) -> list[float]:
        """Simulate a chunk with one call of carsim; results as in :meth:`passes`."""
        bodies, scenes, requests = {}, {}, []
        for index, run in enumerate(chunk):
            # Every run has a body and a scene of its own, both named by its index in the chunk.
            name, design = str(index), self.experiment.designs[run.design]
            reality = drawn_reality(run.values, self.experiment.info.variation, self.seed, run.number, run.car)
            bodies[name], scenes[name] = canonical_json(design.body), canonical_json(run.scene)
            label = f"design {run.design + 1}, drive {run.number}"
            requests.append(
                RunRequest(name, name, design.settings, label, sample=run.number, reality=canonical_json(reality))
            )
        outcomes = [outcome_of(answer) for answer in self._carsim.run(bodies, scenes, requests)]
        return [np.nan if outcome == "failed" else float(outcome == PASSED) for outcome in outcomes]
