"""Opens environments whose samples are drawn under one fixed hash seed, in this process or in another.

Python orders sets of strings by a seed that it reads only at its start. A program that iterates over such a set draws
other scenes under another seed. The command `foldcar` runs with the seed 0. A Python session that imports foldcar has any
seed: there a second process, which has the seed 0, draws the samples. It takes about two seconds to start.

Samples are drawn with Python's global random generators. A scheduler of workers has threads in this process that use
them, too, at any time: beside one, the second process draws as well.
"""

import json
import os
import subprocess
import sys
import threading
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from foldcar.errors import FoldcarError
from foldcar.installation import python_command
from foldcar.read_files import minimal_variables
from foldcar.scenes.object_names import Parameters
from foldcar.scenes.obstacles import Obstacle
from foldcar.scenes.program_files import Files
from foldcar.scenes.source import SceneSource, open_environment, other_scene

# Whether this process draws samples itself: sets have the order of seed 0.
draws_here = not sys.flags.hash_randomization


def draw_elsewhere() -> None:
    """Let another process draw the samples of all environments that are opened from now on."""
    global draws_here
    draws_here = False


def open_fixed_environment(
    program: Path,
    params: Mapping[str, Any],
    seed: int,
    condition: Mapping[str, Any] | None = None,
    files: Files | None = None,
) -> SceneSource:
    """Compile a Scenic program and return the source of its scenes, as open_environment does.

    Its samples are drawn with Python's hash seed 0: in this process if it has this seed, otherwise in another process.

    Example: open_fixed_environment(Path("steps.scenic"), {"friction": 0.5}, 42).sample(3)
    """
    source = open_environment(program, params, seed, condition, files)
    if draws_here:
        return source
    return _SourceElsewhere(source, {"params": params, "condition": condition, "files": files})


class _SourceElsewhere(SceneSource):
    """A source of scenes whose samples another process draws. The process is started when the first sample is drawn."""

    def __init__(self, source: SceneSource, arguments: Mapping[str, Any]) -> None:
        super().__init__(source.program, source.files, source.scenario, source.seed)
        self._opening = {"program": str(source.program), "seed": source.seed, **arguments}
        self._process: subprocess.Popen[str] | None = None
        self._lock = threading.Lock()

    def fixed_files(self) -> Files:
        """Fix and return the program's files, as the other process has read them."""
        self.files.adopt(self._ask({"files": True}))
        return self.files.fix()

    def sample_with_parameters(self, k: int) -> tuple[dict[str, Any], list[Parameters]]:
        scene, objects = self._ask({"sample": k})
        return scene, [(name, parameters) for name, parameters in objects]

    def sample_with_obstacles(self, k: int) -> tuple[dict[str, Any], list[Obstacle]]:
        scene, obstacles = super().sample_with_obstacles(k)
        if json.loads(json.dumps(scene)) != self.sample(k):
            raise other_scene(self.program, k)
        return scene, obstacles

    def _ask(self, question: dict[str, Any]) -> Any:
        """Return the result that the other process answers. Raises FoldcarError if it answers an error, or has died.

        The questions are {"sample": number} and {"files": True}.
        """
        with self._lock:
            if self._process is None:
                # In a session of its own, Ctrl-C does not reach it. It ends when its input ends.
                self._process = subprocess.Popen(
                    python_command("foldcar.scenes.fixed_hash"), stdin=subprocess.PIPE, stdout=subprocess.PIPE,
                    encoding="utf-8", start_new_session=True, env={**minimal_variables(), "PYTHONHASHSEED": "0"},
                )  # fmt: skip
                self._send(self._opening)
            answer = self._send(question)
        if "error" in answer:
            raise FoldcarError(answer["error"])
        return answer["result"]

    def _send(self, line: dict[str, Any]) -> dict[str, Any]:
        """Send a line to the other process and return its answer: {"result": …} or {"error": message}.

        If the process has died, the answer is an error that says so.
        """
        process = self._process
        assert process is not None and process.stdin is not None and process.stdout is not None
        try:
            process.stdin.write(json.dumps(line) + "\n")
            process.stdin.flush()
            answer: dict[str, Any] = json.loads(process.stdout.readline())
        except (OSError, ValueError):
            process.kill()
            return {"error": f"{self.program}: the process that draws its samples has died"}
        return answer


def main() -> None:
    """Draw samples for a _SourceElsewhere in another process.

    The first line of input describes the environment; each further line is a question. Each is answered with a line of
    JSON, until the input ends.
    """
    # What programs print must not mix with the answers.
    answers = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)
    source: SceneSource | None = None
    # Why the environment cannot be opened; "" if it can.
    opening_error = ""
    for line in sys.stdin:
        question = json.loads(line)
        answer: dict[str, Any] = {"result": None}
        try:
            if source is None and not opening_error:
                source = open_environment(
                    program=Path(question["program"]),
                    params=question["params"],
                    seed=question["seed"],
                    condition=question["condition"],
                    files=question["files"],
                )
            elif source is None:
                answer = {"error": opening_error}
            elif "files" in question:
                answer["result"] = dict(source.fixed_files())
            else:
                answer["result"] = source.sample_with_parameters(question["sample"])
        except FoldcarError as error:
            answer = {"error": str(error)}
            # If the environment cannot be opened, all later questions get the same answer.
            opening_error = str(error) if source is None else ""
        answers.write(json.dumps(answer) + "\n")
        answers.flush()
