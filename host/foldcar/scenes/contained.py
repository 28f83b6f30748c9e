"""Runs code of a Scenic program so that this process survives it, in time and where it was.

A program is code with the user's rights, and by mistake it may end the process or leave its folder: then what was asked
for would silently not be done, or be written somewhere else. It may also have an endless loop, or sleep.

The limit is one of wall time, less what the block is not to blame for: the time for which the machine was too busy to
give it a processor (at most BUSY_FACTOR - 1 times the limit), and blocks within `excused`, which wait for a simulator.
So a program that hangs ends in time, and a busy machine refuses nothing that a quiet one accepts. It works in the main
thread only, to which Python delivers signals; other threads have no limit. C code of a library is interrupted when it
returns to Python.
"""

import contextlib
import os
import signal
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from foldcar.errors import FoldcarError

OWN = __name__.partition(".")[0]
BUSY_FACTOR = 4
# The interruption is repeated, because an `except` clause or a destructor can suppress one.
REPEAT_S = 0.5
# Linux tells there for how long (ns) the main thread has run, and has been ready without a processor.
SCHEDULED = Path("/proc/self/schedstat")

_excused_s = 0.0
_excused_since_s: float | None = None


@contextlib.contextmanager
def contained(limit_s: float, what: str, program: Path) -> Iterator[None]:
    """Raise a FoldcarError that begins with ``what`` if code of ``program`` in the block takes too long or ends Python.

    After the block the working folder is what it was before.
    """
    from foldcar.scenes.program import one_line

    ending, owner = os._exit, (os.getpid(), threading.get_ident())

    def refuse(code: int) -> None:
        # A signal's handler and the copies that a program makes of the process may end.
        own = sys._getframe(1).f_globals.get("__name__", "").partition(".")[0] == OWN
        if own or owner != (os.getpid(), threading.get_ident()):
            ending(code)
        raise SystemExit(f"os._exit({code})")

    folder = _working_folder()
    os._exit = refuse  # type: ignore[assignment]
    try:
        with time_limit(limit_s, what):
            yield
    except (SystemExit, KeyboardInterrupt) as error:
        if isinstance(error, KeyboardInterrupt) and signal.getsignal(signal.SIGINT) is signal.default_int_handler:
            raise  # can be a Ctrl-C; foldcar's commands do not raise theirs while a program runs
        raise FoldcarError(f"{what}: {one_line(error, program)}") from error
    finally:
        os._exit = ending
        if folder is not None and _working_folder() != folder:
            os.chdir(folder)


def _working_folder() -> Path | None:
    """None if it has been removed."""
    try:
        return Path.cwd()
    except FileNotFoundError:
        return None


class _TimeUpError(BaseException):
    """Raised by the signal's handler; a BaseException, which `except Exception` does not catch."""


@contextlib.contextmanager
def time_limit(limit_s: float, what: str) -> Iterator[None]:
    """Raise a FoldcarError that begins with ``what`` if the block takes longer than ``limit_s``.

    Outside the main thread, and on Windows, there is no limit.
    """
    if threading.current_thread() is not threading.main_thread() or not hasattr(signal, "setitimer"):
        yield
        return
    inside, up = True, False
    start_s, ready_s = _blamed_s(), _ready_s()

    def interrupt(number: int, frame: Any) -> None:
        nonlocal up
        if not inside:
            return
        took_s = _blamed_s() - start_s
        left_s = limit_s - took_s + min(_ready_s() - ready_s, (BUSY_FACTOR - 1) * limit_s)
        if left_s > 0 and not up:
            signal.setitimer(signal.ITIMER_REAL, max(left_s, 0.001), REPEAT_S)
            return
        up = True
        raise _TimeUpError

    handler = signal.signal(signal.SIGALRM, interrupt)
    outer_s, outer_repeat_s = signal.setitimer(signal.ITIMER_REAL, limit_s, REPEAT_S)
    begun_s = time.monotonic()
    try:
        yield
        if up:
            # The block has suppressed the interruption.
            raise _TimeUpError
    except (_TimeUpError, Exception):
        # Some libraries, such as ctypes, convert the interruption to another error.
        if not up:
            raise
        raise FoldcarError(f"{what} takes longer than the limit of {limit_s:g} s of wall time") from None
    finally:
        inside = False
        if outer_s:
            outer_s = max(outer_s - (time.monotonic() - begun_s), 0.001)
        signal.signal(signal.SIGALRM, handler)
        signal.setitimer(signal.ITIMER_REAL, outer_s, outer_repeat_s)


@contextlib.contextmanager
def excused() -> Iterator[None]:
    """The block does not count for any limit. Not within itself."""
    global _excused_s, _excused_since_s
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    _excused_since_s = time.monotonic()
    try:
        yield
    finally:
        _excused_s += time.monotonic() - _excused_since_s
        _excused_since_s = None


def _blamed_s() -> float:
    """Wall time without what was excused."""
    now_s = time.monotonic()
    return (now_s if _excused_since_s is None else _excused_since_s) - _excused_s


def _ready_s() -> float:
    """For how long this process has waited for a processor; 0 where the system does not tell."""
    try:
        return int(SCHEDULED.read_text().split()[1]) / 1e9
    except (OSError, ValueError, IndexError):
        return 0.0
