"""Processes that are started to be disturbed, and those that they start; nobody else's."""

import os
import random
import resource
import signal
import subprocess
import time
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

from study import FOLDCAR, LossError

import foldcar
from shell_signals import like_a_shell

MARK = "FOLDCAR_TORTURE_MARK"
# Ends a command that hangs; far beyond what a busy machine makes of any.
HANGS_S = 600.0
# How long the undisturbed sweep takes here and now; measured first.
sweep_s = 5.0


def start(folder: Path, words: Sequence[str], limit_bytes: int | None = None) -> "subprocess.Popen[str]":
    """Start foldcar as a shell would; what it starts carries the folder as a mark."""

    def prepare() -> None:
        like_a_shell()
        if limit_bytes is not None:
            resource.setrlimit(resource.RLIMIT_FSIZE, (limit_bytes, limit_bytes))

    return subprocess.Popen(
        [*FOLDCAR, *words], cwd=folder, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        text=True, env={**os.environ, MARK: str(folder)}, start_new_session=True, preexec_fn=prepare,
    )  # fmt: skip


def marked(folder: Path) -> list[int]:
    """The running processes that were started for that folder."""
    found = []
    for entry in Path("/proc").iterdir():
        with suppress(OSError):
            if entry.name.isdigit() and f"{MARK}={folder}\0".encode() in (entry / "environ").read_bytes() + b"\0":
                found.append(int(entry.name))
    return found


def kill(pid: int) -> None:
    """End a process at once, if it is still there."""
    with suppress(ProcessLookupError):
        os.kill(pid, signal.SIGKILL)


def ended(process: "subprocess.Popen[str]") -> tuple[int, str, str]:
    """Exit code, output and errors of a command that is left to end."""
    output, errors = process.communicate(timeout=HANGS_S)
    if "Traceback" in errors and not died_at_start(errors):
        raise LossError(f"a traceback: {errors[-2000:]}")
    return process.returncode, output, errors


def died_at_start(errors: str) -> bool:
    """Whether Ctrl-C came while Python itself was starting: a traceback through no file of foldcar's."""
    return errors.rstrip().endswith("KeyboardInterrupt") and str(Path(foldcar.__file__).parent) not in errors


def require_no_process(folder: Path) -> None:
    """LossError if some are left half a minute later; two looks in a row must find none."""
    end_s, empty = time.monotonic() + 30, 0
    while empty < 2:
        empty = 0 if marked(folder) else empty + 1
        if time.monotonic() > end_s:
            raise LossError(f"processes are left: {marked(folder)}")
        time.sleep(0.02)


def moment(chance: random.Random, share: float = 1.0) -> float:
    """A moment (s) within a sweep that takes :data:`sweep_s`, or a ``share`` of that.

    From the first millisecond on, in every order of magnitude, or evenly.
    """
    last_s = share * sweep_s
    return chance.choice((last_s * chance.random(), 0.001 * (last_s / 0.001) ** chance.random()))


def wait(process: "subprocess.Popen[str]", seconds: float) -> bool:
    """Wait for a while; whether the command still runs."""
    with suppress(subprocess.TimeoutExpired):
        process.wait(seconds)
    return process.poll() is None
