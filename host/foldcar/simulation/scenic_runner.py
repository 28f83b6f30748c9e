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
# How often a run is tried if its worker dies.
MAX_ATTEMPTS = 2


class _Worker(LineProcess):
    """A scenic_worker process for one thread (except `kill`); the line ``opening`` makes it compile the program."""

    def __init__(self, opening: str) -> None:
        """Start a worker process. ``opening`` is the JSON text of the program, sent before its first run."""
        # The environment variables are read only while no program runs in another thread, because programs change them.
        with program_lock:
            environment = minimal_variables()
        # Sets of strings have an order that depends on this seed. It must be the same in all workers.
        environment["PYTHONHASHSEED"] = "0"
        # Threads for linear algebra would only slow down the copies that the worker makes of itself.
        environment["OPENBLAS_NUM_THREADS"] = "1"
        command = python_command("foldcar.simulation.worker", "foldcar.simulation.scenic_worker")
        # In a session of its own, Ctrl-C does not reach the worker; the caller decides what to stop.
        super().__init__(command, env=environment, start_new_session=True)
        # None as soon as the worker has compiled the program.
        self._opening: str | None = opening

    def answer(self, body: str, scene: str, request: RunRequest) -> dict[str, Any] | None:
        """Simulate a run in the worker process. Return its result, {"error": message}, or None if the process has died.

        The first run is preceded by compiling the program. Raises CarsimError if the process refuses the program or the
        run.
        """
        if self._opening is not None:
            ready = self._ask_json(self._opening)
            if ready is None:
                return None
            if "refused" in ready:
                raise CarsimError(str(ready["refused"]))
            self._opening = None
        # `request.keys` are the settings and the differences between the real car and the planned one.
        run = {"body": body, "scene": scene, "settings": request.keys, "sample": request.sample}
        answer = self._ask_json(json.dumps(run))
        if answer is None or "error" in answer:
            return answer
        if "refused" in answer:
            raise CarsimError(f"{request.label}: {answer['refused']}")
        result: dict[str, Any] = answer["result"]
        return result

    def _ask_json(self, line: str) -> dict[str, Any] | None:
        """Send a line and return the JSON object of the answer; None if the process has died."""
        answer_line = self.ask(line)
        if not answer_line:
            return None
        answer: dict[str, Any] | None = json.loads(answer_line)
        return answer

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
        """Remember the environment; the first run starts a worker. See the class for the parameters."""
        if not hasattr(os, "fork"):
            raise CarsimError(f"{program}: runs beside the simulation, which needs Linux or macOS")
        self.program = program
        self.environment: dict[str, Any] = {
            "params": dict(params),
            "seed": seed,
            "condition": None if condition is None else dict(condition),
            "files": None if files is None else dict(files),
        }
        self._opening = json.dumps({"program": str(program), **self.environment, "command": list(command)})
        self._reset_workers()
        self._reset_workers_after_forks()

    def _reset_workers_after_forks(self) -> None:
        """Let each process that this one forks reset its workers, because it must not use those of its parent."""
        # Python keeps the function until the process ends. Through a weak reference, it does not keep this runner, too.
        reference = weakref.ref(self)

        def reset_workers() -> None:
            """Reset the runner's workers, if the runner still exists."""
            runner = reference()
            if runner is not None:
                runner._reset_workers()

        os.register_at_fork(after_in_child=reset_workers)

    def _reset_workers(self) -> None:
        """Forget all workers, without ending them."""
        self._lock, self._idle, self._busy = threading.Lock(), list[_Worker](), set[_Worker]()

    def run(
        self, bodies: Mapping[str, str], scenes: Mapping[str, str], requests: Sequence[RunRequest]
    ) -> list[dict[str, Any]]:
        """Simulate the requested runs one by one in a worker process, and return their answers in order.

        If the worker dies, the run is tried once more in a new worker. If that dies, too, the run has failed.
        """
        answers: list[dict[str, Any]] = []
        worker: _Worker | None = None
        try:
            for request in requests:
                answer: dict[str, Any] | None = None
                for _attempt in range(MAX_ATTEMPTS):
                    if worker is None:
                        worker = self._take_worker()
                    answer = worker.answer(bodies[request.body], scenes[request.scene], request)
                    # `stop`, called in another thread, removes the workers that it ends from the busy ones.
                    if worker not in self._busy:
                        raise CarsimError("stopped")
                    if answer is not None:
                        break
                    return_code = self._end_worker(worker)
                    worker = None
                    failed_run = {"error": f"{CRASH} ({process_ending(return_code)})"}
                answers.append(failed_run if answer is None else answer)
        except BaseException:
            if worker is not None:
                self._end_worker(worker)
            raise
        if worker is not None:
            self._give_back_worker(worker)
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
            worker = self._idle.pop() if self._idle else _Worker(self._opening)
            self._busy.add(worker)
        return worker

    def _give_back_worker(self, worker: _Worker) -> None:
        """Mark a busy worker as idle, unless `stop` has ended it."""
        with self._lock:
            if worker in self._busy:
                self._busy.remove(worker)
                self._idle.append(worker)

    def _end_worker(self, process: _Worker) -> int:
        """Kill a worker and return its return code."""
        with self._lock:
            self._busy.discard(process)
        process.kill()
        return process.close()
