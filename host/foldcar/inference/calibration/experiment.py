"""A swept experiment of a store as a calibration takes it: its designs and scenes, and runs of them.

Input: a store and the name of an experiment. Output: a SweptExperiment, without listing and program; how runs under
changed parameters went, in order, the same for any number of processes. Raises FoldcarError.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property, partial
from itertools import islice
from typing import Any, TypeVar

from foldcar.car.variation import vary_body
from foldcar.errors import FoldcarError
from foldcar.inference.calibration.drive_features import PASSED, TIME, drive_end, path_features, told_features
from foldcar.inference.calibration.effects import calibrated_scene, calibrated_variation
from foldcar.inference.calibration.parameters import FloatArray
from foldcar.simulation.carsim import Carsim
from foldcar.simulation.compact_path import answered_path
from foldcar.simulation.results import outcome_of
from foldcar.simulation.runner import RunRequest, side_by_side
from foldcar.store.info import ExperimentInfo
from foldcar.store.reader import Store
from foldcar.store.stored_drives import read_drives
from foldcar.store.writer import canonical_json

# Fewer scenes are no sample of an environment.
LEAST_SCENES = 20
CHUNK_RUNS = 60
# A parameter set whose runs the simulator cannot compute is left out, but only in rare cases.
MOST_FAILED = 0.02

T = TypeVar("T")


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

    def varied(self, design: int) -> dict[str, float]:
        """The parameters of a design, by its index, that tell it from others of its family."""
        return {name: float(self.designs[design].parameters[name]) for name in self.info.varied}

    @cached_property
    def _indices(self) -> dict[frozenset[tuple[str, float]], int]:
        return {frozenset(design.parameters.items()): i for i, design in enumerate(self.designs)}


def read_experiment(store: Store, name: str) -> SweptExperiment:
    """The experiment ``name`` of ``store``. Raises FoldcarError."""
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
    drives = read_drives(store, name)
    if drives.dynamic:
        raise FoldcarError(
            f"{place}: {info.scenic_program} runs beside the simulation, whose scenes cannot be changed; calibrate in an "
            "environment whose program only places things"
        )
    scenes = [drives.value("scene", scene) for scene in drives.scenes.values()]
    if len(scenes) < LEAST_SCENES:
        raise FoldcarError(
            f"{place}: the store has {len(scenes)} scenes of its environment, a calibration needs {LEAST_SCENES}: "
            f"sweep with --environments {LEAST_SCENES} or more"
        )
    designs = [
        SweptDesign(parameters, drives.value("body", body), drives.text("settings", settings))
        for parameters, body, settings in zip(drives.parameters, drives.bodies, drives.settings, strict=True)
    ]
    return SweptExperiment(info, tuple(designs), tuple(scenes))


def nominal_counts(store: Store, experiment: SweptExperiment) -> dict[int, tuple[int, int]]:
    """How many of how many nominal runs that belong in a rate passed, by the design's index."""
    counts = store.design_counts(experiment.info.id)
    return dict(enumerate(zip(counts.passed, counts.counted, strict=True)))


@dataclass(frozen=True, slots=True)
class CalibrationRun:
    """A design by its index, under ``values``, in a scene of docs/carsim.md.

    ``car`` chooses the car's differences from the design, ``number`` what scatters from drive to drive.
    """

    design: int
    values: Mapping[str, float]
    scene: Mapping[str, Any]
    car: int
    number: int


@dataclass(frozen=True, slots=True)
class SimulatedDrive:
    """How a run went: ``end`` and ``features`` as :mod:`foldcar.inference.calibration.drive_features` has them."""

    end: int
    features: FloatArray

    @property
    def passed(self) -> bool:
        """Whether it reached the goal."""
        return self.end == 0


class Simulator:
    """Simulates runs of one experiment. ``seed`` is that of everything that scatters."""

    def __init__(self, experiment: SweptExperiment, carsim: Carsim, jobs: int, seed: int) -> None:
        self.experiment = experiment
        self.seed = seed
        self._carsim = carsim
        self._limits = carsim.limits().numbers
        self._jobs = jobs

    def drives(
        self, runs: Iterable[CalibrationRun], done: Callable[[int], None] = lambda runs: None
    ) -> list[SimulatedDrive | None]:
        """How each run went, None if it failed; ``done`` is called with finished runs. Raises FoldcarError."""
        results = self.answers(runs, _drive, done)
        failed = results.count(None)
        if failed > MOST_FAILED * len(results):
            raise FoldcarError(
                f"experiment {self.experiment.info.id}: {failed} of {len(results)} simulations with changed parameters "
                "failed"
            )
        return results

    def answers(
        self,
        runs: Iterable[CalibrationRun],
        read: Callable[[dict[str, Any], CalibrationRun], T],
        done: Callable[[int], None] = lambda runs: None,
    ) -> list[T]:
        """What ``read`` makes of carsim's answer to each run, in order."""
        left = iter(runs)
        results: list[T] = []
        chunks = iter(lambda: list(islice(left, CHUNK_RUNS)), [])
        for finished in side_by_side(
            (partial(self._run, read, chunk) for chunk in chunks), self._jobs, self._carsim.stop
        ):
            results += finished
            done(len(finished))
        return results

    def _run(self, read: Callable[[dict[str, Any], CalibrationRun], T], chunk: list[CalibrationRun]) -> list[T]:
        bodies, scenes, requests = {}, {}, []
        for name, run in zip(map(str, range(len(chunk))), chunk, strict=True):
            design = self.experiment.designs[run.design]
            variation = calibrated_variation(run.values, self.experiment.info.variation, self.seed, run.car)
            bodies[name] = canonical_json(vary_body(design.body, variation, self._limits))
            scenes[name] = canonical_json(calibrated_scene(run.scene, run.values, self.seed, run.number))
            label = f"design {run.design + 1}, drive {run.number}"
            requests.append(RunRequest(name, name, design.settings, label, run.number, compact_path=True))
        answers = self._carsim.run(bodies, scenes, requests)
        return [read(answer, run) for answer, run in zip(answers, chunk, strict=True)]


def _drive(answer: dict[str, Any], run: CalibrationRun) -> SimulatedDrive | None:
    outcome = outcome_of(answer)
    if outcome == "failed":
        return None
    features = path_features(answered_path(answer), run.scene)
    features[TIME] = told_features(answer["elapsed_time_s"], outcome == PASSED)[TIME]
    return SimulatedDrive(drive_end(outcome, features), features)
