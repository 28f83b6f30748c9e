"""Runs of designs under values of the parameters, in several simulator processes.

Input: a swept experiment and runs one by one, each with its own values, scene and scatter. Output: whether each passed,
in order; they are the same for any number of processes.
"""

from collections.abc import Callable, Iterable, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from itertools import islice

from foldcar.calibration.effects import calibrated_scene, calibrated_variation
from foldcar.calibration.experiment import SweptExperiment
from foldcar.car.variation import vary_body
from foldcar.errors import FoldcarError
from foldcar.simulation.carsim import Carsim
from foldcar.simulation.results import outcome_of
from foldcar.simulation.runner import RunRequest
from foldcar.store.writer import canonical_json

CHUNK_RUNS = 60
# A parameter set whose runs the simulator cannot compute is left out, but only in rare cases.
MOST_FAILED = 0.02


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
        waiting: list[Future[list[bool | None]]] = []
        pool = ThreadPoolExecutor(self._jobs, thread_name_prefix="carsim")
        try:
            while True:
                # One chunk waits behind every running one, so that no process waits for this thread.
                while len(waiting) < 2 * self._jobs and (chunk := list(islice(left, CHUNK_RUNS))):
                    waiting.append(pool.submit(self._run, *self._inputs(chunk)))
                if not waiting:
                    break
                finished = waiting.pop(0).result()
                results += finished
                done(len(finished))
        except BaseException:
            self._carsim.stop()
            raise
        finally:
            pool.shutdown(cancel_futures=True)
        failed = results.count(None)
        if failed > MOST_FAILED * len(results):
            raise FoldcarError(
                f"experiment {self.experiment.info.id}: {failed} of {len(results)} simulations with changed parameters "
                "failed"
            )
        return results

    def _inputs(self, chunk: list[CalibrationRun]) -> tuple[dict[str, str], dict[str, str], list[RunRequest]]:
        bodies, scenes, requests = {}, {}, []
        for index, run in enumerate(chunk):
            design = self.experiment.designs[run.design]
            variation = calibrated_variation(run.values, self.experiment.info.variation, self.seed, run.number)
            scene = calibrated_scene(self.experiment.scenes[run.scene], run.values, self.seed, run.number)
            name = str(index)
            bodies[name] = canonical_json(vary_body(design.body, variation, self._limits))
            scenes[name] = canonical_json(scene)
            label = f"design {run.design + 1}, sample {run.scene}"
            requests.append(RunRequest(name, name, design.settings, label, run.scene))
        return bodies, scenes, requests

    def _run(self, bodies: dict[str, str], scenes: dict[str, str], requests: list[RunRequest]) -> list[bool | None]:
        outcomes = [outcome_of(answer) for answer in self._carsim.run(bodies, scenes, requests)]
        return [None if outcome == "failed" else outcome == "passed" for outcome in outcomes]
