"""Runs of carsim in processes that stay: a single run costs its computing, not also the start of a process.

The answers are those of :class:`foldcar.simulation.carsim.Carsim`. For callers that want one run after another; sweeps
send runs in chunks, whose processes are soon paid for.
"""

import contextlib
import os
import subprocess
import threading
import weakref
from collections.abc import Mapping, Sequence
from typing import Any

from foldcar.simulation.carsim import Carsim, input_line, run_line
from foldcar.simulation.runner import CarsimError, RunRequest


class KeptCarsim:
    """A Runner on ``carsim``'s program. A process for each call under way is kept until `close`, or the end of Python."""

    def __init__(self, carsim: Carsim) -> None:
        self.carsim = carsim
        self._lock = threading.Lock()
        self._idle: list[_Process] = []
        self._busy: set[_Process] = set()
        # A forked process must not talk to its parent's simulators.
        reference = weakref.ref(self)
        os.register_at_fork(after_in_child=lambda: _forget(reference()))

    def run(
        self, bodies: Mapping[str, str], scenes: Mapping[str, str], requests: Sequence[RunRequest]
    ) -> list[dict[str, Any]]:
        """As :meth:`foldcar.simulation.carsim.Carsim.run`."""
        answers = []
        process = self._take()
        try:
            for request in requests:
                line = process.ask(bodies[request.body], scenes[request.scene], request)
                if line:
                    answers.append(self.carsim.read_answer(line, [request]))
                    continue
                if process not in self._busy:
                    raise CarsimError(f"{self.carsim.binary}: stopped")
                # The process has died: of this run, if a new one dies too.
                answers += self.carsim.run(bodies, scenes, [request])
                self._drop(process)
                process = self._take()
        except BaseException:
            self._drop(process)
            raise
        with self._lock:
            if process in self._busy:
                self._busy.remove(process)
                self._idle.append(process)
        return answers

    def stop(self) -> None:
        """End every call that is under way; it raises CarsimError."""
        with self._lock:
            busy, self._busy = self._busy, set()
        for process in busy:
            process.end()
        self.carsim.stop()

    def close(self) -> None:
        """End all processes; the next call starts new ones."""
        self.stop()
        with self._lock:
            idle, self._idle = self._idle, []
        for process in idle:
            process.end()

    def _take(self) -> "_Process":
        with self._lock:
            process = self._idle.pop() if self._idle else _Process(self.carsim)
            self._busy.add(process)
        return process

    def _drop(self, process: "_Process") -> None:
        with self._lock:
            self._busy.discard(process)
        process.end()


class _Process:
    """One `carsim batch`, which knows the last body and the last scene."""

    def __init__(self, carsim: Carsim) -> None:
        command = [*carsim.command, "batch"]
        try:
            # A session of its own keeps Ctrl-C from the simulator: the caller decides what is to end.
            self._process = subprocess.Popen(
                command,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
                encoding="utf-8",
                errors="replace",
                start_new_session=True,
            )
        except OSError as error:
            raise CarsimError(f"{carsim.binary}: cannot be started: {error.strerror}") from error
        self._known: dict[str, str] = {}

    def ask(self, body: str, scene: str, request: RunRequest) -> str:
        """The line that answers the run; "" if the process has died before its end."""
        lines = [
            input_line(kind, kind, text)
            for kind, text in (("body", body), ("scene", scene))
            if self._known.get(kind) != text
        ]
        self._known = {"body": body, "scene": scene}
        lines.append(run_line("0", RunRequest("body", "scene", request.settings, request.label, request.sample)))
        assert self._process.stdin is not None and self._process.stdout is not None
        try:
            self._process.stdin.write("\n".join(lines) + "\n")
            self._process.stdin.flush()
            answer = self._process.stdout.readline()
        except (OSError, ValueError):
            return ""
        return answer if answer.endswith("\n") else ""

    def end(self) -> None:
        """Kill the process; it has nothing to tidy up."""
        self._process.kill()
        self._process.wait()
        assert self._process.stdin is not None
        # What was written for a dead process goes nowhere.
        with contextlib.suppress(OSError):
            self._process.stdin.close()


def _forget(kept: KeptCarsim | None) -> None:
    if kept is not None:
        kept._lock, kept._idle, kept._busy = threading.Lock(), [], set()
