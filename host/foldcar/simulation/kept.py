"""Processes that answer line by line and stay: a single run costs its computing, not also the start of a process."""

import contextlib
import os
import signal
import subprocess
import threading
import weakref
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Generic, TypeVar

from foldcar.simulation.runner import CarsimError, RunRequest, process_ending


class LineProcess:
    """A process that answers lines; for one thread. CarsimError if it cannot be started."""

    def __init__(self, command: Sequence[str], **options: Any) -> None:
        try:
            self._process = subprocess.Popen(
                command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, encoding="utf-8", errors="replace", **options
            )
        except OSError as error:
            raise CarsimError(f"{command[0]}: cannot be started: {error.strerror}") from error

    def ask(self, *lines: str) -> str:
        """The line that answers ``lines``; "" if the process has died before its end."""
        assert self._process.stdin is not None and self._process.stdout is not None
        with contextlib.suppress(OSError, ValueError):
            self._process.stdin.write("\n".join(lines) + "\n")
            self._process.stdin.flush()
            answer: str = self._process.stdout.readline()
            if answer.endswith("\n"):
                return answer
        return ""

    def close(self) -> int:
        """Ask nothing more and wait for its end: its return code."""
        for pipe in (self._process.stdin, self._process.stdout):
            assert pipe is not None
            with contextlib.suppress(OSError):
                pipe.close()
        return self._process.wait()


class RunProcess(LineProcess):
    """A process that simulates, for one thread, but for `kill`. A session of its own keeps Ctrl-C from it."""

    # What has happened to a run of which it dies.
    crash = "the simulation crashed"

    def __init__(self, command: Sequence[str], **options: Any) -> None:
        super().__init__(command, start_new_session=True, **options)

    def answer(self, body: str, scene: str, request: RunRequest) -> dict[str, Any] | None:
        """The answer to a run, None if the process has died. CarsimError if it refuses what it is given."""
        raise NotImplementedError

    def kill(self) -> None:
        """Kill the process, with its copies and simulators: they are the process group of its session."""
        if self._process.returncode is None:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(self._process.pid, signal.SIGKILL)


P = TypeVar("P", bound=RunProcess)


class KeptRunner(Generic[P]):
    """A Runner with a process of ``start`` for each call under way, kept until `close`. For several threads."""

    def __init__(self, start: Callable[[], P]) -> None:
        self._start = start
        self._forget()
        reference = weakref.ref(self)

        def forget() -> None:
            if (kept := reference()) is not None:
                kept._forget()

        # A forked process must not talk to its parent's.
        os.register_at_fork(after_in_child=forget)

    def _forget(self) -> None:
        self._lock, self._idle, self._busy = threading.Lock(), list[P](), set[P]()

    def run(
        self, bodies: Mapping[str, str], scenes: Mapping[str, str], requests: Sequence[RunRequest]
    ) -> list[dict[str, Any]]:
        """As in Runner."""
        answers: list[dict[str, Any]] = []
        process: P | None = None
        try:
            for request in requests:
                answer, ending = None, ""
                # A process that dies takes the run with it only if the next one dies of it too.
                for _ in range(2):
                    process = process or self._take()
                    answer = process.answer(bodies[request.body], scenes[request.scene], request)
                    if process not in self._busy:
                        raise CarsimError("stopped")
                    if answer is not None:
                        break
                    ending, process = f"{process.crash} ({process_ending(self._drop(process))})", None
                answers.append({"error": ending} if answer is None else answer)
        except BaseException:
            if process is not None:
                self._drop(process)
            raise
        with self._lock:
            if process in self._busy:
                self._busy.remove(process)
                self._idle.append(process)
        return answers

    def stop(self) -> None:
        """As in Runner."""
        with self._lock:
            busy, self._busy = self._busy, set()
        for process in busy:
            process.kill()

    def close(self) -> None:
        """End all processes; the next call starts new ones."""
        self.stop()
        with self._lock:
            idle, self._idle = self._idle, []
        for process in idle:
            process.close()

    def _take(self) -> P:
        with self._lock:
            process = self._idle.pop() if self._idle else self._start()
            self._busy.add(process)
        return process

    def _drop(self, process: P) -> int:
        with self._lock:
            self._busy.discard(process)
        process.kill()
        return process.close()
