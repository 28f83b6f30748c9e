"""Interrupts Python code that takes too long, such as a Scenic program with an endless loop.

The limit is one of processor time, so that a busy machine refuses nothing that a quiet one accepts; code that waits
instead of computing is interrupted after WALL_FACTOR times as long. It works in the main thread only, to which Python
delivers signals; other threads have none. C code of a library is interrupted when it returns to Python.
"""

import contextlib
import signal
import threading
from collections.abc import Iterator
from typing import Any

from foldcar.errors import FoldcarError

WALL_FACTOR = 20
# The interruption is repeated, because an `except` clause or a destructor can suppress one.
REPEAT_S = 0.5


class _TimeUpError(BaseException):
    """Raised by the signals' handler; a BaseException, which `except Exception` does not catch."""


@contextlib.contextmanager
def time_limit(limit_s: float, what: str) -> Iterator[None]:
    """Raise a FoldcarError that begins with ``what`` if the block needs more than ``limit_s`` of processor time.

    The time is that of the whole process. The block is also interrupted WALL_FACTOR * ``limit_s`` of wall time after
    its beginning. Outside the main thread, and on Windows, there is no limit.
    """
    if threading.current_thread() is not threading.main_thread() or not hasattr(signal, "setitimer"):
        yield
        return
    inside, up = True, False

    def interrupt(number: int, frame: Any) -> None:
        nonlocal up
        if inside:
            up = True
            raise _TimeUpError

    timers = (
        (signal.SIGPROF, signal.ITIMER_PROF, limit_s),
        (signal.SIGALRM, signal.ITIMER_REAL, WALL_FACTOR * limit_s),
    )
    handlers = [signal.signal(number, interrupt) for number, _, _ in timers]
    outer = [signal.setitimer(timer, seconds, REPEAT_S) for _, timer, seconds in timers]
    try:
        yield
    except (_TimeUpError, Exception):
        # Some libraries, such as ctypes, convert the interruption to another error.
        if not up:
            raise
        raise FoldcarError(f"{what} takes longer than the limit of {limit_s:g} s") from None
    finally:
        inside = False
        for (number, timer, _), handler, (seconds, repeat_s) in zip(timers, handlers, outer, strict=True):
            signal.setitimer(timer, seconds, repeat_s)
            signal.signal(number, handler)
