"""Runs a Scenic program for a sweep, one run at a time, as a process of its own (see scenic_runner and worker).

Input: JSON Lines. First what to open, {"program", "params", "seed", "condition", "files", "command"}; then one line a
run, {"body", "scene", "settings": JSON texts, "sample"}. Output: one line each, {"ready": true} and then
{"result": …}, {"error": message} for a run that failed, or {"refused": message} where the input is at fault. Ends with
its input.

A program may change anything that it reaches. So each sample is drawn in a copy of the process in the state after
compiling, and each run takes place in a copy of that one: no run can depend on others.
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
from foldcar.scenes.source import SceneSource, open_environment, other_scene, seeded
from foldcar.simulation.carsim_step import SimulatorDiedError, SteppedCarsim, TrialFailedError
from foldcar.simulation.runner import CarsimError
from foldcar.simulation.worker import Forked, answers_on

# Wall time of one run. The longest takes a few seconds: what exceeds this hangs.
RUN_LIMIT_S = 480.0


def main() -> None:
    """Serve standard input until its end."""
    # What a program prints must not get between the answers.
    with os.fdopen(os.dup(sys.stdout.fileno()), "w", encoding="utf-8") as output:
        os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
        answers_on(output.fileno())
        opening = json.loads(sys.stdin.readline() or "null")
        if opening is None:
            return
        try:
            worker = ScenicWorker(opening)
        except FoldcarError as error:
            _say(output, {"refused": str(error)})
            return
        with closing(worker):
            _say(output, {"ready": True})
            for line in sys.stdin:
                _say(output, worker.answer(json.loads(line)))


class ScenicWorker:
    """A compiled program beside carsim. Raises FoldcarError if the program cannot be opened."""

    def __init__(self, opening: dict[str, Any]) -> None:
        self._source: SceneSource = open_environment(
            Path(opening["program"]), opening["params"], opening["seed"], opening["condition"], opening["files"]
        )
        # What every run needs is done before the process is copied.
        from scenic.core import dynamics

        from foldcar.simulation.scenic_simulator import CarSimulator

        # Scenic warns of a monitor that hangs by a timer of its own, which would end that of RUN_LIMIT_S.
        dynamics.stuckBehaviorWarningTimeout = 0
        self._simulator = CarSimulator
        self._passing = self._source.success.endings
        self._command = opening["command"]
        self._open = ExitStack()
        self._carsim: SteppedCarsim | None = None
        self._copy: Forked | None = None
        self._sample: int | None = None
        self._scene: Any = None
        self._described: dict[str, Any] = {}

    def close(self) -> None:
        """End the simulator and the copy."""
        self._open.close()

    def answer(self, request: dict[str, Any]) -> dict[str, Any]:
        """The answer to one run."""
        if self._copy is None or self._sample != request["sample"]:
            self._open.close()
            self._copy = self._open.enter_context(Forked(self._answer_for_sample))
            self._sample = request["sample"]
        return self._copy.ask(request)

    def _answer_for_sample(self, request: dict[str, Any]) -> dict[str, Any]:
        """In the copy for one sample: draw it, unless that is done, and run in another copy."""
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
        """The answer in this process. A simulator that dies in it is given the run once more, in a new process."""
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
        k, program = request["sample"], self._source.program
        self._open_sample(k)
        if self._described != json.loads(request["scene"]):
            raise other_scene(program, k)
        assert self._carsim is not None
        body, settings, scene = request["body"], request["settings"], str(request["scene"])
        simulator = self._simulator(self._carsim, body, settings, lambda _: scene, self._passing)
        place = f"{program}: sample {k}"
        with self._source.files.inside():
            try:
                with seeded(f"{self._source.seed}/{k}/run"), contained(RUN_LIMIT_S, "running", program):
                    return simulator.run(self._scene)
            except FoldcarError as error:
                # A CarsimError is no mistake of the program, all others come with what it records.
                raise error if isinstance(error, CarsimError) else TrialFailedError(f"{place}: {error}") from None
            except Exception as error:
                raise TrialFailedError(f"{place}: {one_line(error, program)}") from error

    def _open_sample(self, k: int) -> None:
        if self._sample == k and self._scene is not None:
            return
        self._sample, self._scene = None, None
        scene = self._source.scenic_scene(k)
        self._described = self._source.describe(scene, k)
        self._sample, self._scene = k, scene


def _say(output: TextIO, answer: dict[str, Any]) -> None:
    output.write(json.dumps(answer) + "\n")
    output.flush()
