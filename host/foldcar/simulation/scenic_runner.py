"""Runs of programs that need Scenic beside the simulation, in worker processes: the counterpart of carsim's batch.

Input: bodies, scenes and settings as JSON text, and which sample each scene is. Output: one answer a run, in order: a
result of carsim with "recorded" (see scenic_simulator), or ``{"error": message}`` for a run that failed. Scenic runs one
simulation a process at a time, hence one worker for each call under way; each compiles the program once.
"""

import contextlib
import json
import os
import signal
import subprocess
import threading
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from foldcar.python_command import python_command
from foldcar.scenes.program_files import Files
from foldcar.simulation.process_ending import process_ending
from foldcar.simulation.runner import CarsimError, RunRequest


class ScenicRunner:
    """Worker processes for one environment. `run` and `stop` may be called from several threads at once.

    ``condition`` is the listing's, or None; ``files`` are what the program must consist of (see open_environment);
    ``command`` starts carsim (see Carsim). ``environment`` holds what the environment is besides its program's place, by
    the names of these arguments.
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
        self._lock = threading.Lock()
        self._idle: list[_Worker] = []
        self._busy: set[_Worker] = set()

    def run(
        self, bodies: Mapping[str, str], scenes: Mapping[str, str], requests: Sequence[RunRequest]
    ) -> list[dict[str, Any]]:
        """Answers to ``requests`` in order. ``bodies`` and ``scenes`` map ids to JSON objects as text.

        Raises CarsimError if the program cannot be opened, if the simulator refuses its input, or after `stop`.
        """
        answers = []
        worker: _Worker | None = None
        try:
            for request in requests:
                line = json.dumps(
                    {
                        "body": bodies[request.body],
                        "scene": scenes[request.scene],
                        "settings": request.settings,
                        "sample": request.sample,
                    }
                )
                # A worker that dies takes the run with it only if the next one dies of it too.
                for _ in range(2):
                    worker = worker or self._take()
                    answer = worker.ask(line)
                    if worker.alive:
                        break
                    self._drop(worker)
                    worker = None
                if "refused" in answer:
                    raise CarsimError(f"{request.label}: {answer['refused']}")
                answers.append(answer["result"] if "result" in answer else {"error": str(answer["error"])})
        except BaseException:
            if worker is not None:
                self._drop(worker)
                worker = None
            raise
        finally:
            if worker is not None:
                with self._lock:
                    self._busy.discard(worker)
                    self._idle.append(worker)
        return answers

    def stop(self) -> None:
        """End every run that is under way; its `run` raises CarsimError."""
        with self._lock:
            for worker in self._busy:
                worker.stop()

    def close(self) -> None:
        """End all processes. Nothing may be under way."""
        with self._lock:
            idle, self._idle = self._idle, []
        for worker in idle:
            worker.close()

    def _take(self) -> "_Worker":
        with self._lock:
            worker = self._idle.pop() if self._idle else _Worker()
            self._busy.add(worker)
        try:
            worker.open(self._opening)
        except BaseException:
            self._drop(worker)
            raise
        return worker

    def _drop(self, worker: "_Worker") -> None:
        with self._lock:
            self._busy.discard(worker)
        worker.stop()
        worker.close()


class _Worker:
    """One worker process; for one thread, but for `stop`."""

    def __init__(self) -> None:
        self._stopped = False
        self._opened = False
        # A session of its own keeps Ctrl-C from it: the caller decides what is to end.
        self._process = subprocess.Popen(
            python_command("foldcar.simulation.worker", "foldcar.simulation.scenic_worker"),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            encoding="utf-8",
            # As in foldcar/__main__.py, for those who call from Python. Threads for linear algebra would do nothing but
            # make every copy of the process slower.
            env={**os.environ, "PYTHONHASHSEED": "0", "OPENBLAS_NUM_THREADS": "1"},
            start_new_session=True,
        )

    @property
    def alive(self) -> bool:
        return self._process.poll() is None and self._opened

    def open(self, opening: str) -> None:
        """Compile the program, if that has not been done."""
        if self._opened:
            return
        answer = self.ask(opening)
        if "ready" not in answer:
            raise CarsimError(str(answer.get("refused") or answer.get("error")))
        self._opened = True

    def stop(self) -> None:
        self._stopped = True
        self._kill_all()

    def close(self) -> None:
        for pipe in (self._process.stdin, self._process.stdout):
            if pipe is not None:
                with contextlib.suppress(OSError):
                    pipe.close()
        self._process.wait()

    def ask(self, line: str) -> dict[str, Any]:
        """The answer to a line; an ``error`` if the worker dies of it. CarsimError after `stop`."""
        assert self._process.stdin is not None and self._process.stdout is not None
        reply = ""
        with contextlib.suppress(OSError):
            self._process.stdin.write(line + "\n")
            self._process.stdin.flush()
            reply = self._process.stdout.readline()
        if reply.endswith("\n"):
            answer: dict[str, Any] = json.loads(reply)
            return answer
        self._opened = False
        self._kill_all()
        return_code = self._process.wait()
        if self._stopped:
            raise CarsimError("stopped")
        return {"error": f"the process that simulates with Scenic died ({process_ending(return_code)})"}

    def _kill_all(self) -> None:
        """Kill the process with its copies and simulators, which are the process group of its session."""
        if self._process.returncode is not None:
            return
        with contextlib.suppress(ProcessLookupError):
            os.killpg(self._process.pid, signal.SIGKILL)
