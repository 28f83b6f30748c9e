"""Interrupts Python code that takes too long, such as a Scenic program with an endless loop.

The limit works in the main thread only, to which Python delivers signals; other threads have none. C code of a
library is interrupted when it returns to Python.
"""

import contextlib
import signal
import threading
from collections.abc import Iterator
from typing import Any

from foldcar.errors import FoldcarError

# The interruption is repeated, because an `except` clause or a destructor can suppress one.
REPEAT_S = 0.5


class _TimeUpError(BaseException):
    """Raised by the signal's handler; a BaseException, which `except Exception` does not catch."""


@contextlib.contextmanager
def time_limit(limit_s: float, what: str) -> Iterator[None]:
    """Raise a FoldcarError that begins with ``what`` if the block takes longer than ``limit_s``."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    inside, up = True, False

    def interrupt(number: int, frame: Any) -> None:
        nonlocal up
        if inside:
            up = True
            raise _TimeUpError

    previous = signal.signal(signal.SIGALRM, interrupt)
    outer_s, outer_repeat_s = signal.setitimer(signal.ITIMER_REAL, limit_s, REPEAT_S)
    try:
        yield
    except (_TimeUpError, Exception):
        # Some libraries, such as ctypes, convert the interruption to another error.
        if not up:
            raise
        raise FoldcarError(f"{what} takes longer than the limit of {limit_s:g} s") from None
    finally:
        inside = False
        signal.setitimer(signal.ITIMER_REAL, outer_s, outer_repeat_s)
        signal.signal(signal.SIGALRM, previous)
