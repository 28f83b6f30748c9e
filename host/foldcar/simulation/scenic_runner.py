"""Runs dynamic programs with Scenic beside the simulation in worker processes: the counterpart of carsim's batch.

Input: bodies, scenes and settings as JSON text, and the sample of each scene. Output: one answer a run, in order: a
result of carsim with "recorded" (see scenic_simulator), or ``{"error": message}`` for a failed run. A Scenic process runs
one simulation at a time, so there is a worker for each running call. A worker compiles the program once and is reused.
"""

import contextlib
import json
import os
import threading
import weakref
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from foldcar.installation import python_command
from foldcar.read_files import minimal_variables
from foldcar.scenes.program_files import Files, program_lock
from foldcar.simulation.carsim_step import LineProcess
from foldcar.simulation.runner import CarsimError, RunRequest, process_ending
from foldcar.system import kill_group

# The error of a run whose worker dies.
CRASH = "the process that simulates with Scenic died"


class _Worker(LineProcess):
    """A scenic_worker process for one thread (except `kill`); the line ``opening`` makes it compile the program."""

    def __init__(self, opening: str) -> None:
        """Start a worker process. ``opening`` is the JSON text of the program, sent before its first run."""
        # A fixed hash seed gives sets of strings the same order in all workers. Threads for linear algebra would only
        # slow down copies of the process.
        # Programs that other threads run change the variables meanwhile.
        with program_lock:
            environment = {**minimal_variables(), "PYTHONHASHSEED": "0", "OPENBLAS_NUM_THREADS": "1"}
        command = python_command("foldcar.simulation.worker", "foldcar.simulation.scenic_worker")
        # In a session of its own, Ctrl-C does not reach it.
        super().__init__(command, env=environment, start_new_session=True)
        self._opening: str | None = opening

    def answer(self, body: str, scene: str, request: RunRequest) -> dict[str, Any] | None:
        """Simulate a run in the worker process. Return its result, {"error": message}, or None if the process has died.

        Raises CarsimError if the process refuses the program or the run.
        """
        if self._opening is not None:
            ready = json.loads(self.ask(self._opening) or "null")
            if ready is None:
                return None
            if "refused" in ready:
                raise CarsimError(str(ready["refused"]))
            self._opening = None
        # `keys` has the settings and the reality.
        run = {"body": body, "scene": scene, "settings": request.keys, "sample": request.sample}
        answer: dict[str, Any] | None = json.loads(self.ask(json.dumps(run)) or "null")
        if answer is not None and "refused" in answer:
            raise CarsimError(f"{request.label}: {answer['refused']}")
        return answer if answer is None or "error" in answer else answer["result"]

    def kill(self) -> None:
        """Kill the process with its copies and simulators, which form the process group of its session."""
        if self._process.returncode is None:
            with contextlib.suppress(ProcessLookupError):
                kill_group(self._process)


class ScenicRunner:
    """A Runner with workers for one environment, which live until `close`. Raises CarsimError if the program fails.

    ``condition`` is the listing's, or None. ``files`` are the files that the program must consist of (see
    open_environment). ``command`` starts carsim (see Carsim). ``environment`` has these arguments, except the program and
    the command, by name.
    """

    def __init__(
        self,
        program: Path,
        params: Mapping[str, Any],
        seed: int,
        condition: Mapping[str, Any] | None,
        files: Files | None,
        command: Sequence[str],
    ) -> None:
        self.program = program
        self.environment: dict[str, Any] = {
            "params": dict(params),
            "seed": seed,
            "condition": None if condition is None else dict(condition),
            "files": None if files is None else dict(files),
        }
        self._opening = json.dumps({"program": str(program), **self.environment, "command": list(command)})
        self._reset_workers()
        # Handlers of forks cannot be removed, so this one must not keep the runner alive.
        reference = weakref.ref(self)

        def reset_workers() -> None:
            if (runner := reference()) is not None:
                runner._reset_workers()

        if not hasattr(os, "fork"):
            raise CarsimError(f"{program}: runs beside the simulation, which needs Linux or macOS")
        # A forked process must not use its parent's workers.
        os.register_at_fork(after_in_child=reset_workers)

    def _reset_workers(self) -> None:
        """Forget all workers, without ending them."""
        self._lock, self._idle, self._busy = threading.Lock(), list[_Worker](), set[_Worker]()

    def run(
        self, bodies: Mapping[str, str], scenes: Mapping[str, str], requests: Sequence[RunRequest]
    ) -> list[dict[str, Any]]:
        """Simulate the requested runs one by one in a worker process, and return their answers in order."""
        answers: list[dict[str, Any]] = []
        process: _Worker | None = None
        try:
            for request in requests:
                answer, ending = None, ""
                # If the process dies, the run is tried once more in a new one. If that dies, too, the run has failed.
                for _ in range(2):
                    process = process or self._take_worker()
                    answer = process.answer(bodies[request.body], scenes[request.scene], request)
                    # If a worker is no longer among the busy ones, `stop` has ended it.
                    if process not in self._busy:
                        raise CarsimError("stopped")
                    if answer is not None:
                        break
                    ending = f"{CRASH} ({process_ending(self._end_worker(process))})"
                    process = None
                answers.append({"error": ending} if answer is None else answer)
        except BaseException:
            if process is not None:
                self._end_worker(process)
            raise
        with self._lock:
            if process in self._busy:
                self._busy.remove(process)
                self._idle.append(process)
        return answers

    def stop(self) -> None:
        """Stop all running calls of `run`, which raise CarsimError."""
        with self._lock:
            busy, self._busy = self._busy, set()
        for process in busy:
            process.kill()

    def close(self) -> None:
        """End all processes; the next call starts new ones."""
        self.stop()
        self.close_idle()

    def close_idle(self) -> None:
        """End the processes that wait for a call."""
        with self._lock:
            idle, self._idle = self._idle, []
        for process in idle:
            process.close()

    def _take_worker(self) -> _Worker:
        """Return an idle worker, or a new one, and mark it as busy."""
        with self._lock:
            process = self._idle.pop() if self._idle else _Worker(self._opening)
            self._busy.add(process)
        return process

    def _end_worker(self, process: _Worker) -> int:
        """Kill a worker and return its return code."""
        with self._lock:
            self._busy.discard(process)
        process.kill()
        return process.close()
