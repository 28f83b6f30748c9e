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
from typing import Any, NamedTuple, TextIO

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


class _DrawnSample(NamedTuple):
    """A sample of the environment: its number, its scene as Scenic has drawn it, and the same scene for carsim."""

    number: int
    scene: Any
    described: dict[str, Any]


class ScenicWorker:
    """Simulates runs of a compiled Scenic program with carsim. Raises FoldcarError if the program cannot be opened."""

    def __init__(self, first_message: dict[str, Any]) -> None:
        """Compile the Scenic program of the first message that this process receives. All runs that follow are of it."""
        self._source: SceneSource = open_environment(
            Path(first_message["program"]),
            first_message["params"],
            first_message["seed"],
            first_message["condition"],
            first_message["files"],
        )
        # Imported before this process is forked, because every run needs it.
        from scenic.core import dynamics

        from foldcar.simulation.scenic_simulator import CarSimulator

        # Scenic's own timer, which warns of monitors that hang, would cancel the timer of RUN_LIMIT_S.
        dynamics.stuckBehaviorWarningTimeout = 0
        self._simulator = CarSimulator
        # The conditions that end a run as passed.
        self._passing = self._source.success.endings
        self._command = first_message["command"]
        # What this process has to close at its end.
        self._open = ExitStack()
        self._carsim: SteppedCarsim | None = None
        # A sample is a scene that the program draws at random. A fork of this process simulates the runs of one sample;
        # this is the fork, and the number of its sample.
        self._copy: Forked | None = None
        self._sample_of_copy: int | None = None
        # The sample that this process, as such a fork, has drawn.
        self._drawn: _DrawnSample | None = None

    def close(self) -> None:
        """End the simulator and the copy."""
        self._open.close()

    def answer(self, request: dict[str, Any]) -> dict[str, Any]:
        """Return the answer to one run, from the copy of this process for the run's sample."""
        if self._copy is None or self._sample_of_copy != request["sample"]:
            self._open.close()
            self._copy = self._open.enter_context(Forked(self._answer_for_sample))
            self._sample_of_copy = request["sample"]
        return self._copy.ask(request)

    def _answer_for_sample(self, request: dict[str, Any]) -> dict[str, Any]:
        """Answer a request for a run. This is called in a fork of the process that serves one sample of the scene.

        The first call generates the scene of the sample. Each run is simulated in a fork of this fork, so that every run
        starts from the same state.
        """
        try:
            self._draw(request["sample"])
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
        draws the scene of the request, or if one of its files has changed.
        """
        number = request["sample"]
        drawn = self._draw(number)
        if drawn.described != json.loads(request["scene"]):
            raise other_scene_error(self._source.program, number)
        # This also checks the program's files at the end, so it must surround the handling of the program's errors.
        with self._source.files.inside():
            return self._simulate(request, drawn)

    def _simulate(self, request: dict[str, Any], drawn: "_DrawnSample") -> dict[str, Any]:
        """Simulate a run in a drawn sample and return its result. Raises TrialFailedError if the program has an error."""
        assert self._carsim is not None
        source = self._source
        # carsim gets the scene exactly as the request has it, instead of a new text of the drawn scene.
        scene_text = str(request["scene"])
        simulator = self._simulator(
            self._carsim, request["body"], request["settings"], lambda _scene: scene_text, self._passing
        )
        # Random numbers that the program draws while it runs depend only on its seed and on the sample.
        run_seed = f"{source.seed}/{drawn.number}/run"
        place = f"{source.program}: sample {drawn.number}"
        try:
            with seeded(run_seed), contained(RUN_LIMIT_S, "running", source.program):
                return simulator.run(drawn.scene)
        except CarsimError:
            # The simulator has failed or refused its input, which is not an error of the program.
            raise
        except FoldcarError as error:
            # The program has recorded a value that cannot be stored.
            raise TrialFailedError(f"{place}: {error}") from None
        except Exception as error:
            raise TrialFailedError(f"{place}: {one_line(error, source.program)}") from error

    def _draw(self, number: int) -> "_DrawnSample":
        """Return the sample with this number. It is drawn only if this process has not drawn it already."""
        if self._drawn is None or self._drawn.number != number:
            # If drawing fails, no sample must be left.
            self._drawn = None
            scene = self._source.scenic_scene(number)
            self._drawn = _DrawnSample(number, scene, self._source.describe(scene, number))
        return self._drawn


def _write_line(output: TextIO, answer: dict[str, Any]) -> None:
    output.write(json.dumps(answer) + "\n")
    output.flush()
