"""Runs a Scenic program for a sweep, one run at a time, in a separate process (see scenic_runner and worker).

Input: JSON Lines. The first line says what to open: {"program", "params", "seed", "condition", "files", "command"}. Each
further line is a run: {"body", "scene", "settings": JSON texts, "sample"}. Output: one line each, first {"ready": true},
then {"result": …}, {"error": message} for a failed run, or {"refused": message} for invalid input. The process ends with
its input.

A program may change any object in memory. Therefore each sample is drawn in a copy of the process after compiling, and
each run takes place in a copy of that copy, so that no run depends on others.
"""

import json
import os
import sys
from contextlib import ExitStack, closing
from pathlib import Path
from typing import Any, TextIO

from foldcar.errors import FoldcarError
from foldcar.scenes.contained import contained
from foldcar.scenes.program import one_line
from foldcar.scenes.source import SceneSource, open_environment, other_scene_error, seeded
from foldcar.simulation.carsim_step import SimulatorDiedError, SteppedCarsim, TrialFailedError
from foldcar.simulation.runner import CarsimError
from foldcar.simulation.worker import Forked, set_answer_descriptors

# Limit of a run's wall time. Runs take a few seconds at most, so a longer one hangs.
RUN_LIMIT_S = 480.0


def main() -> None:
    """Run the worker process: answer the requests on standard input, line by line, until its end."""
    # Answers are written to a copy of standard output. Standard output itself becomes standard error, so that what a
    # program prints does not mix with the answers.
    with os.fdopen(os.dup(sys.stdout.fileno()), "w", encoding="utf-8") as output:
        os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
        set_answer_descriptors(output.fileno())
        opening = json.loads(sys.stdin.readline() or "null")
        if opening is None:
            return
        try:
            worker = ScenicWorker(opening)
        except FoldcarError as error:
            _write_line(output, {"refused": str(error)})
            return
        with closing(worker):
            _write_line(output, {"ready": True})
            for line in sys.stdin:
                _write_line(output, worker.answer(json.loads(line)))


class ScenicWorker:
    """Simulates runs of a compiled Scenic program with carsim. Raises FoldcarError if the program cannot be opened."""

    def __init__(self, first_message: dict[str, Any]) -> None:
        """Compile the Scenic program that the first message names, for all runs that follow."""
        self._source: SceneSource = open_environment(
            Path(first_message["program"]),
            first_message["params"],
            first_message["seed"],
            first_message["condition"],
            first_message["files"],
        )
        # Import before the process is copied, because every run needs this.
        from scenic.core import dynamics

        from foldcar.simulation.scenic_simulator import CarSimulator

        # Scenic's own timer, which warns of monitors that hang, would cancel the timer of RUN_LIMIT_S.
        dynamics.stuckBehaviorWarningTimeout = 0
        self._simulator = CarSimulator
        self._passing = self._source.success.endings
        self._command = first_message["command"]
        self._open = ExitStack()
        self._carsim: SteppedCarsim | None = None
        # A copy of this process, which simulates the runs of one sample.
        self._copy: Forked | None = None
        # The last sample drawn: its number, its scene for Scenic, and its scene for carsim.
        self._sample: int | None = None
        self._scene: Any = None
        self._described: dict[str, Any] = {}

    def close(self) -> None:
        """End the simulator and the copy."""
        self._open.close()

    def answer(self, request: dict[str, Any]) -> dict[str, Any]:
        """Return the answer to one run, from the copy of this process for the run's sample."""
        if self._copy is None or self._sample != request["sample"]:
            self._open.close()
            self._copy = self._open.enter_context(Forked(self._answer_for_sample))
            self._sample = request["sample"]
        return self._copy.ask(request)

    def _answer_for_sample(self, request: dict[str, Any]) -> dict[str, Any]:
        """Answer a request for a run. This is called in the copy of the process that belongs to the run's sample.

        The first call draws the sample. Each run is simulated in a copy of this copy, so that every run starts from the
        same state.
        """
        try:
            self._open_sample(request["sample"])
        except FoldcarError as error:
            return {"refused": str(error)}
        with Forked(self._answer_in_copy) as copy:
            return copy.ask(request)

    def _answer_in_copy(self, request: dict[str, Any]) -> dict[str, Any]:
        with SteppedCarsim(self._command) as self._carsim:
            return self._answer(request)

    def _answer(self, request: dict[str, Any]) -> dict[str, Any]:
        """Simulate a run in this process; if the simulator dies, retry once with a new one."""
        try:
            try:
                return {"result": self._run(request)}
            except SimulatorDiedError:
                return {"result": self._run(request)}
        except TrialFailedError as error:
            return {"error": str(error)}
        except FoldcarError as error:
            return {"refused": str(error)}

    def _run(self, request: dict[str, Any]) -> dict[str, Any]:
        """Simulate a run and return its result.

        Raises TrialFailedError if the program has an error during the run, and FoldcarError if the program no longer
        draws the scene of the request.
        """
        sample, program = request["sample"], self._source.program
        self._open_sample(sample)
        if self._described != json.loads(request["scene"]):
            raise other_scene_error(program, sample)
        assert self._carsim is not None
        body, settings, scene = request["body"], request["settings"], str(request["scene"])
        # carsim gets the text of the scene from the store, instead of a new description of the drawn scene.
        simulator = self._simulator(self._carsim, body, settings, lambda _: scene, self._passing)
        place = f"{program}: sample {sample}"
        with self._source.files.inside():
            try:
                with seeded(f"{self._source.seed}/{sample}/run"), contained(RUN_LIMIT_S, "running", program):
                    return simulator.run(self._scene)
            except FoldcarError as error:
                # A CarsimError is not the program's fault. All other errors come from the program's records.
                if isinstance(error, CarsimError):
                    raise
                raise TrialFailedError(f"{place}: {error}") from None
            except Exception as error:
                raise TrialFailedError(f"{place}: {one_line(error, program)}") from error

    def _open_sample(self, sample: int) -> None:
        """Draw the ``sample``, unless it is the last one drawn."""
        if self._sample == sample and self._scene is not None:
            return
        self._sample, self._scene = None, None
        scene = self._source.scenic_scene(sample)
        self._described = self._source.describe(scene, sample)
        self._sample, self._scene = sample, scene


def _write_line(output: TextIO, answer: dict[str, Any]) -> None:
    output.write(json.dumps(answer) + "\n")
    output.flush()
