"""Runs of programs that need Scenic beside the simulation, in worker processes: the counterpart of carsim's batch.

Input: bodies, scenes and settings as JSON text, and which sample each scene is. Output: one answer a run, in order: a
result of carsim with "recorded" (see scenic_simulator), or ``{"error": message}`` for a run that failed. Scenic runs one
simulation a process at a time, hence one worker for each call under way; each compiles the program once.
"""

import json
import os
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from foldcar.installation import python_command
from foldcar.scenes.program_files import Files
from foldcar.simulation.kept import KeptRunner, RunProcess
from foldcar.simulation.runner import CarsimError, RunRequest


class _Worker(RunProcess):
    """One scenic_worker; ``opening`` is the line with which it compiles the program."""

    crash = "the process that simulates with Scenic died"

    def __init__(self, opening: str) -> None:
        # As in foldcar/__main__.py, for those who call from Python. Threads for linear algebra would do nothing but make
        # every copy of the process slower.
        environment = {**os.environ, "PYTHONHASHSEED": "0", "OPENBLAS_NUM_THREADS": "1"}
        command = python_command("foldcar.simulation.worker", "foldcar.simulation.scenic_worker")
        super().__init__(command, env=environment)
        self._opening: str | None = opening

    def answer(self, body: str, scene: str, request: RunRequest) -> dict[str, Any] | None:
        """As in RunProcess."""
        if self._opening is not None:
            ready = json.loads(self.ask(self._opening) or "null")
            if ready is None:
                return None
            if "refused" in ready:
                raise CarsimError(str(ready["refused"]))
            self._opening = None
        run = {"body": body, "scene": scene, "settings": request.settings, "sample": request.sample}
        answer: dict[str, Any] | None = json.loads(self.ask(json.dumps(run)) or "null")
        if answer is not None and "refused" in answer:
            raise CarsimError(f"{request.label}: {answer['refused']}")
        return answer if answer is None or "error" in answer else answer["result"]


class ScenicRunner(KeptRunner[_Worker]):
    """Worker processes for one environment. CarsimError of a run also if the program cannot be opened.

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
        opening = {"program": str(program), **self.environment, "command": list(command)}
        super().__init__(partial(_Worker, json.dumps(opening)))
