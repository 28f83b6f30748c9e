"""`python -m foldcar.simulation.scenic_worker`: runs a Scenic program for a sweep, one run at a time (see scenic_runner).

Input: JSON Lines. First what to open, {"program", "params", "seed", "condition", "binary", "engine"}; then one line a
run, {"body", "scene", "settings": JSON texts, "sample"}. Output: one line each, {"ready": true} and then
{"result": …}, {"error": message} for a run that failed, or {"refused": message} where the input is at fault. Ends with
its input.
"""

import json
import os
import sys
from collections.abc import Callable
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any, TextIO

from foldcar.errors import FoldcarError
from foldcar.scenes.program import one_line
from foldcar.scenes.program_globals import ProgramGlobals
from foldcar.scenes.source import SceneSource, open_environment, seeded
from foldcar.scenes.time_limit import time_limit
from foldcar.simulation.carsim_step import SimulatorDiedError, SteppedCarsim, SteppedTrial, TrialFailedError
from foldcar.simulation.runner import CarsimError

# Wall time of one run. The longest trial takes a few seconds: what exceeds this hangs.
RUN_LIMIT_S = 120.0


def main() -> None:
    """Serve standard input until its end."""
    serve(lambda opening: SteppedCarsim(Path(opening["binary"])))


def serve(engine: Callable[[dict[str, Any]], AbstractContextManager[SteppedTrial]]) -> None:
    """The same, with the engine that is made of what to open."""
    # What a program prints must not get between the answers.
    with os.fdopen(os.dup(sys.stdout.fileno()), "w", encoding="utf-8") as output:
        os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
        opening = json.loads(sys.stdin.readline() or "null")
        if opening is None:
            return
        with engine(opening) as carsim:
            try:
                worker = ScenicWorker(opening, carsim)
            except FoldcarError as error:
                _say(output, {"refused": str(error)})
                return
            _say(output, {"ready": True})
            for line in sys.stdin:
                _say(output, worker.answer(json.loads(line)))


class ScenicWorker:
    """A compiled program beside a simulator. Raises FoldcarError if it cannot be opened."""

    def __init__(self, opening: dict[str, Any], carsim: SteppedTrial) -> None:
        self._source: SceneSource = open_environment(
            Path(opening["program"]), opening["params"], opening["seed"], opening["condition"]
        )
        self._carsim = carsim
        self._globals = ProgramGlobals(self._source.scenario)
        self._sample: int | None = None
        self._scene: Any = None
        self._described: dict[str, Any] = {}

    def answer(self, request: dict[str, Any]) -> dict[str, Any]:
        """The answer to one run. A simulator that dies in it is given the run once more, in a new process."""
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
        from foldcar.simulation.scenic_simulator import CarSimulator

        k = request["sample"]
        self._open_sample(k)
        if self._described != json.loads(request["scene"]):
            raise FoldcarError(
                f"{self._source.program}: sample {k} is another scene now than when it was stored: the program "
                "depends on more than its parameters, its seed and the files beside it"
            )
        simulator = CarSimulator(
            self._carsim,
            request["body"],
            request["settings"],
            lambda _: str(request["scene"]),
            self._source.success.endings,
        )
        place = f"{self._source.program}: sample {k}"
        # Each run begins like the first one, whatever ran in this process before.
        self._globals.restore()
        try:
            with seeded(f"{self._source.seed}/{k}/run"), time_limit(RUN_LIMIT_S, "running"):
                return simulator.run(self._scene)
        except FoldcarError as error:
            # A CarsimError is no mistake of the program, all others come with what it records.
            raise error if isinstance(error, CarsimError) else TrialFailedError(f"{place}: {error}") from None
        except Exception as error:
            raise TrialFailedError(f"{place}: {one_line(error, self._source.program)}") from error

    def _open_sample(self, k: int) -> None:
        if self._sample == k:
            return
        self._sample = None
        self._scene = self._source.scenic_scene(k)
        self._described = self._source.describe(self._scene, k)
        self._sample = k


def _say(output: TextIO, answer: dict[str, Any]) -> None:
    output.write(json.dumps(answer) + "\n")
    output.flush()


if __name__ == "__main__":
    main()
