"""Runs code of a Scenic program with a time limit, so that this process and its working folder survive it.

A program is code with the user's rights. By mistake it may end Python, change the working folder, loop or sleep for
ever. Then a command would silently do nothing, or write into another folder.

The limit is wall time. It works in the main thread only, to which Python delivers signals; other threads have no limit.
C code of a library is interrupted when it returns to Python.
"""

import contextlib
import os
import signal
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from foldcar.errors import FoldcarError

# The interruption is repeated, because an `except` clause or a destructor can suppress one.
REPEAT_S = 0.5


@contextlib.contextmanager
def contained(limit_s: float, what: str, program: Path) -> Iterator[None]:
    """Run code of ``program`` in the block. Raises FoldcarError, beginning with ``what``, if it takes too long or exits.

    After the block the working folder is what it was before.
    """
    from foldcar.scenes.program import one_line

    folder = Path.cwd()
    try:
        with time_limit(limit_s, what):
            yield
    except SystemExit as error:
        raise FoldcarError(f"{what}: {one_line(error, program)}") from error
    finally:
        os.chdir(folder)


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
    # The signal handler reads the first variable and sets the second one.
    in_block = True
    time_is_up = False

    def interrupt(number: int, frame: Any) -> None:
        """Handle the timer's signal: interrupt the block, but not what comes after it."""
        nonlocal time_is_up
        if in_block:
            time_is_up = True
            raise _TimeUpError

    outer_handler = signal.signal(signal.SIGALRM, interrupt)
    # The signal repeats, because the block may suppress the first interruption. This block may lie within another block
    # with a time limit. Then setitimer returns the time that the outer block has left, and its timer is set again at the
    # end.
    outer_s, outer_repeat_s = signal.setitimer(signal.ITIMER_REAL, limit_s, REPEAT_S)
    started_s = time.monotonic()
    try:
        yield
        if time_is_up:
            # The block has suppressed the interruption.
            raise _TimeUpError
    except (_TimeUpError, Exception):
        # Some libraries, such as ctypes, convert the interruption to another error.
        if not time_is_up:
            raise
        raise FoldcarError(f"{what} takes longer than the limit of {limit_s:g} s of wall time") from None
    finally:
        in_block = False
        if outer_s:
            # If the outer block has no time left, its timer must fire at once. 0 would switch it off.
            outer_s = max(outer_s - (time.monotonic() - started_s), 0.001)
        signal.signal(signal.SIGALRM, outer_handler)
        signal.setitimer(signal.ITIMER_REAL, outer_s, outer_repeat_s)
