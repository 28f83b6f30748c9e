"""`foldcar` in copies of a process that has imported it all: like a new process for each command, without its imports.

A command takes a second or two of processor time to import Scenic, matplotlib and their like, more than most tests need
besides. Started as a program with a socket's descriptor, this file imports everything once and then forks for each
command. A copy has its own arguments, environment, folder, signals and exit code; nothing comes back from it. What a
command imports itself, how it ends before it has, and what other hash seeds change, is for tests that start Python.
"""

import atexit
import gc
import importlib
import json
import os
import pkgutil
import select
import signal
import socket
import struct
import subprocess
import sys
import threading
import traceback
import warnings
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any, NoReturn

import numpy

import foldcar
from shell_signals import like_a_shell

PROGRAM = Path(__file__).resolve().parents[2] / "scenarios" / "two_bumps.scenic"
# Ends a test that hangs; far beyond what a busy machine makes of any command.
HANGS_S = 600.0
MESSAGE_BYTES = 200_000
NUMBER = struct.Struct("i")
# These are programs; the second is Webots' to run.
PROGRAMS = {"foldcar.__main__", "foldcar.models.foldcar_pulses", "foldcar.simulation.worker"}
# Imported by commands as they go.
LIBRARIES = ("matplotlib.pyplot", "mujoco", "scenic", "scenic.syntax.veneer")


class ForkedProcess:
    """A running copy, like a subprocess.Popen. ``pipes`` are our ends of its input, output and errors, if any."""

    def __init__(self, words: Sequence[str], answers: int, pipes: Sequence[int] = ()) -> None:
        self.args = ["foldcar", *words]
        self.returncode: int | None = None
        self._answers = answers
        answer = os.read(answers, NUMBER.size)
        assert answer, "the process that imports foldcar for the tests has ended"
        (self.pid,) = NUMBER.unpack(answer)
        if pipes:
            self.stdin, self.stdout, self.stderr = os.fdopen(pipes[0], "w"), os.fdopen(pipes[1]), os.fdopen(pipes[2])

    def communicate(self, input: str = "", timeout: float = HANGS_S) -> tuple[str, str]:
        """What is left of its output and errors when it has ended; it is killed after ``timeout`` seconds."""
        hangs = threading.Timer(timeout, self.kill)
        hangs.start()
        with self.stdout, self.stderr, ThreadPoolExecutor(2) as threads:
            printed = [threads.submit(stream.read) for stream in (self.stdout, self.stderr)]
            # A command that does not ask for its input has closed it.
            with suppress(BrokenPipeError):
                if input:
                    self.stdin.write(input)
                self.stdin.close()
            texts = printed[0].result(), printed[1].result()
        self.wait()
        assert hangs.is_alive(), f"{self.args} was not done after {timeout} s: {texts}"
        hangs.cancel()
        return texts

    def wait(self, timeout: float | None = None) -> int:
        """The exit code; below 0 the number of the signal that ended it."""
        if self.returncode is None:
            if not select.select([self._answers], [], [], timeout)[0]:
                raise subprocess.TimeoutExpired(self.args, timeout or 0.0)
            (self.returncode,) = NUMBER.unpack(os.read(self._answers, NUMBER.size))
            os.close(self._answers)
        return self.returncode

    def poll(self) -> int | None:
        """The exit code, if it has ended."""
        with suppress(subprocess.TimeoutExpired):
            self.wait(0)
        return self.returncode

    def send_signal(self, number: int) -> None:
        """Send a signal, unless it has ended."""
        if self.poll() is None:
            os.kill(self.pid, number)

    def terminate(self) -> None:
        """Ask it to end."""
        self.send_signal(signal.SIGTERM)

    def kill(self) -> None:
        """End it at once."""
        self.send_signal(signal.SIGKILL)


class ForkedFoldcar:
    """The original, and what it is asked. Ends with its socket."""

    def __init__(self) -> None:
        self._socket, other = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        with other:
            self._original = subprocess.Popen(
                [sys.executable, __file__, str(other.fileno())], preexec_fn=like_a_shell, start_new_session=True,
                stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, pass_fds=(other.fileno(),),
                # With this hash seed foldcar itself runs.
                env={**os.environ, "PYTHONHASHSEED": "0"},
            )  # fmt: skip

    def close(self) -> None:
        """End the original."""
        self._socket.close()
        self._original.wait()

    def start(
        self, words: Sequence[str], folder: Path, env: Mapping[str, str] | None = None, files: Sequence[int] | None = None
    ) -> ForkedProcess:
        """Start `foldcar` with these words in ``folder``; input, output and errors are ``files``, or pipes."""
        request = {"words": words, "folder": str(folder), "env": dict(os.environ if env is None else env)}
        answers, answered = os.pipe()
        pipes = [] if files else [os.pipe() for _ in range(3)]
        child_ends = [pipes[0][0], pipes[1][1], pipes[2][1]] if pipes else []
        ours = [pipes[0][1], pipes[1][0], pipes[2][0]] if pipes else []
        socket.send_fds(self._socket, [json.dumps(request).encode()], [*(files or child_ends), answered])
        for descriptor in (*child_ends, answered):
            os.close(descriptor)
        return ForkedProcess(words, answers, ours)

    def run(
        self, words: Sequence[str], folder: Path, env: Mapping[str, str] | None = None, input: str = ""
    ) -> "subprocess.CompletedProcess[str]":
        """What `foldcar` does with these words."""
        process = self.start(words, folder, env)
        texts = process.communicate(input)
        return subprocess.CompletedProcess(process.args, process.wait(), *texts)


@cache
def original() -> ForkedFoldcar:
    """The process that makes the copies for this one, started by the first call."""
    runner = ForkedFoldcar()
    atexit.register(runner.close)
    return runner


def import_all() -> None:
    """Import every module of foldcar, which imports what they use, and what commands import as they go."""
    for module in pkgutil.walk_packages(foldcar.__path__, "foldcar."):
        if module.name not in PROGRAMS:
            importlib.import_module(module.name)
    for library in LIBRARIES:
        importlib.import_module(library)
    from foldcar.scenes.program import compile_program

    # Scenic imports some of itself when it compiles, and the vocabulary is parsed once.
    compile_program(PROGRAM, {})
    # Garbage collection in a copy would write to, and so copy, every page with an object on it.
    gc.collect()
    gc.freeze()


def serve(requests: socket.socket) -> None:
    """Run commands in copies of this process until the socket's other end is closed; tell their numbers and ends."""
    # A copy has none of the other threads, which are libraries' for linear algebra.
    warnings.simplefilter("ignore", DeprecationWarning)
    events = select.poll()
    events.register(requests, select.POLLIN)
    # By a descriptor that becomes readable when the copy ends: the copy and where to tell it.
    running: dict[int, tuple[int, int]] = {}
    while True:
        for descriptor, _ in events.poll():
            if descriptor in running:
                events.unregister(descriptor)
                copy, answered = running.pop(descriptor)
                os.close(descriptor)
                code = os.waitstatus_to_exitcode(os.waitpid(copy, 0)[1])
                # Nobody may ask any more.
                with suppress(BrokenPipeError):
                    os.write(answered, NUMBER.pack(code))
                os.close(answered)
                continue
            message, given, _, _ = socket.recv_fds(requests, MESSAGE_BYTES, 4)
            if not message:
                return
            copy = os.fork()
            if copy == 0:
                requests.close()
                os.close(given[3])
                _be_foldcar(json.loads(message), given[:3])
            for stream in given[:3]:
                os.close(stream)
            os.write(given[3], NUMBER.pack(copy))
            ended = os.pidfd_open(copy)
            events.register(ended, select.POLLIN)
            running[ended] = copy, given[3]


def _be_foldcar(request: dict[str, Any], files: list[int]) -> NoReturn:
    """Run the command as if Python had been started for it, and end."""
    for number, descriptor in enumerate(files):
        os.dup2(descriptor, number)
        os.close(descriptor)
    os.chdir(request["folder"])
    os.environ.clear()
    os.environ.update(request["env"])
    # Python has chosen before how it buffers its output.
    sys.stdout.reconfigure(line_buffering=os.isatty(1), write_through="PYTHONUNBUFFERED" in request["env"])
    sys.argv = ["foldcar", *request["words"]]
    numpy.random.seed()
    # What imports have registered belongs to the original.
    atexit._clear()
    from foldcar.cli import main

    code: Any = 0
    try:
        main()
    except SystemExit as end:
        code = end.code or 0
    except BaseException:
        traceback.print_exc()
        code = 1
    threading._shutdown()  # type: ignore[attr-defined]
    atexit._run_exitfuncs()
    try:
        sys.stdout.flush()
        sys.stderr.flush()
    except OSError:
        code = 120
    os._exit(code if isinstance(code, int) else 1)


if __name__ == "__main__":
    import_all()
    serve(socket.socket(fileno=int(sys.argv[1])))
