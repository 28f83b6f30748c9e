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
import weakref
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from foldcar.errors import FoldcarError
from foldcar.installation import python_command
from foldcar.read_files import minimal_variables
from foldcar.scenes.object_names import Parameters
from foldcar.scenes.obstacles import Obstacle
from foldcar.scenes.program_files import Files, program_lock
from foldcar.scenes.source import SceneSource, open_environment, other_scene_error

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

    Random samples depend on Python's hash seed, so they are drawn with the hash seed 0. If this process has another hash
    seed, a second process draws them.

    Example: open_fixed_environment(Path("steps.scenic"), {"friction": 0.5}, 42).sample(3)
    """
    source = open_environment(program, params, seed, condition, files)
    if draws_here:
        return source
    return _SourceElsewhere(source, {"params": params, "condition": condition, "files": files})


# How many processes wait for questions, each in about 170 MB. When another one starts, the oldest ends; if it is asked
# again, a new one takes its place.
MAX_PROCESSES = 4
# The sources whose processes wait, oldest first.
_waiting: "list[weakref.ref[_SourceElsewhere]]" = []
_sources: "weakref.WeakSet[_SourceElsewhere]" = weakref.WeakSet()


# The numbers of a process's standard output and standard error.
STDOUT, STDERR = 1, 2


class _SourceElsewhere(SceneSource):
    """A source of scenes whose samples another process draws. The process is started when the first sample is drawn."""

    def __init__(self, source: SceneSource, arguments: Mapping[str, Any]) -> None:
        super().__init__(source.program, source.files, source.scenario, source.seed)
        self.has_drawn_early = source.has_drawn_early
        self._opening = {"program": str(source.program), "seed": source.seed, **arguments}
        self.forget_process()
        _sources.add(self)

    def forget_process(self) -> None:
        """Forget the process without ending it: in a forked process, it is the parent's."""
        self._process: subprocess.Popen[str] | None = None
        self._lock = threading.Lock()

    def end_process(self) -> None:
        """End the process, unless it is drawing a sample."""
        if self._lock.acquire(blocking=False):
            try:
                process, self._process = self._process, None
            finally:
                self._lock.release()
            if process is not None:
                _end(process)

    def fixed_files(self) -> Files:
        """Fix and return the program's files, as the other process has read them."""
        self.files.adopt(self._ask({"files": True}))
        fixed = self.files.fix()
        self._opening["files"] = dict(fixed)
        return fixed

    def sample_with_parameters(self, k: int) -> tuple[dict[str, Any], list[Parameters]]:
        scene, objects = self._ask({"sample": k})
        return scene, [(name, parameters) for name, parameters in objects]

    def sample_with_obstacles(self, k: int) -> tuple[dict[str, Any], list[Obstacle]]:
        scene, obstacles = super().sample_with_obstacles(k)
        if json.loads(json.dumps(scene)) != self.sample(k):
            raise other_scene_error(self.program, k)
        return scene, obstacles

    def _ask(self, question: dict[str, Any]) -> Any:
        """Return the result that the other process answers. Raises FoldcarError if it answers an error, or has died.

        The questions are {"sample": number} and {"files": True}.
        """
        with self._lock:
            # The process is kept only after a whole answer. If Ctrl-C or a notebook's button interrupts this function,
            # the answer is still to come, and would be taken for that of the next question.
            process, self._process = self._process, None
            process = process or self._start()
            try:
                answer = self._send(process, question)
            except BaseException:
                _end(process)
                raise
            if answer is None:
                _end(process)
                raise FoldcarError(f"{self.program}: the process that draws its samples has died")
            self._process = process
        if "error" in answer:
            raise FoldcarError(answer["error"])
        return answer["result"]

    def _start(self) -> "subprocess.Popen[str]":
        """Return a new process that has opened the program. Raises FoldcarError if the program has changed since."""
        # While a program runs in another thread, which holds this lock, the environment variables are changed.
        with program_lock:
            variables = {**minimal_variables(), "PYTHONHASHSEED": "0"}
        # The process has a session of its own, so Ctrl-C does not reach it. It ends when its input ends.
        process = subprocess.Popen(
            python_command("foldcar.scenes.fixed_hash"), stdin=subprocess.PIPE, stdout=subprocess.PIPE,
            encoding="utf-8", start_new_session=True, env=variables,
        )  # fmt: skip
        try:
            # If the program cannot be opened, the answers to all later questions say why.
            self._send(process, self._opening)
            # If the program was edited since this object opened it, the process has opened another version.
            self.files.require_unchanged()
        except BaseException:
            _end(process)
            raise
        # Only a few processes may wait at the same time, so an older one may have to end.
        _make_room(self)
        return process

    @staticmethod
    def _send(process: "subprocess.Popen[str]", line: dict[str, Any]) -> dict[str, Any] | None:
        """Send a line to a process and return its answer: {"result": …} or {"error": message}; None if it has died."""
        assert process.stdin is not None and process.stdout is not None
        try:
            process.stdin.write(json.dumps(line) + "\n")
            process.stdin.flush()
            answer: dict[str, Any] = json.loads(process.stdout.readline())
        except (OSError, ValueError):
            return None
        return answer


def _make_room(newest: _SourceElsewhere) -> None:
    """Note that ``newest`` has a process, and end the oldest ones beyond MAX_PROCESSES."""
    waiting = [source for reference in _waiting if (source := reference()) is not None and source is not newest]
    _waiting[:] = [weakref.ref(source) for source in (*waiting, newest)][-MAX_PROCESSES:]
    for source in waiting[: 1 - MAX_PROCESSES]:
        source.end_process()


def _end(process: "subprocess.Popen[str]") -> None:
    """Kill a process and wait until it has ended."""
    process.kill()
    with suppress(OSError, ValueError):
        process.communicate()


def _forget_processes() -> None:
    for source in list(_sources):
        source.forget_process()
    _waiting.clear()


# Two processes that share one pipe would get each other's answers.
if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_forget_processes)


def main() -> None:
    """Draw samples for a _SourceElsewhere in another process.

    The first line of input describes the environment; each further line is a question. Each is answered with a line of
    JSON, until the input ends.
    """
    # Answers go to the standard output. What programs print must not mix with them, so it goes to the standard error.
    answers = os.fdopen(os.dup(STDOUT), "w", encoding="utf-8")
    os.dup2(STDERR, STDOUT)

    def send(answer: Mapping[str, Any]) -> None:
        """Write an answer as a line of JSON."""
        answers.write(json.dumps(answer) + "\n")
        answers.flush()

    first_line = sys.stdin.readline()
    if not first_line:
        return
    description = json.loads(first_line)
    try:
        source = open_environment(
            program=Path(description["program"]),
            params=description["params"],
            seed=description["seed"],
            condition=description["condition"],
            files=description["files"],
        )
    except FoldcarError as opening_error:
        # Every question gets the same answer.
        send({"error": str(opening_error)})
        for _ in sys.stdin:
            send({"error": str(opening_error)})
        return
    send({"result": None})
    for line in sys.stdin:
        try:
            send({"result": _answer(source, json.loads(line))})
        except FoldcarError as error:
            send({"error": str(error)})


def _answer(source: SceneSource, question: Mapping[str, Any]) -> Any:
    """Return the answer to a question about an environment: its files, or one of its samples. Raises FoldcarError."""
    if "files" in question:
        return dict(source.fixed_files())
    return source.sample_with_parameters(question["sample"])
