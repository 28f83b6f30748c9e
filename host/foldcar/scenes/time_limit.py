"""Interrupts Python code that takes too long, such as a Scenic program that loops.

Works in the main thread of a process, where Python delivers signals; in other threads there is no limit.
What runs outside Python, in a library's C code, ends before it is interrupted.
"""

import contextlib
import signal
import threading
from collections.abc import Iterator
from typing import Any

from foldcar.errors import FoldcarError

# An `except` clause or a destructor of the code can swallow one interruption: there are more.
REPEAT_S = 0.5


class _TimeUpError(BaseException):
    """Not an Exception, lest a program that handles errors goes on."""


@contextlib.contextmanager
def time_limit(limit_s: float, what: str) -> Iterator[None]:
    """Raise FoldcarError, beginning with ``what``, if the block takes longer than ``limit_s``."""
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
        # A library may have made an error of its own of the interruption: ctypes does.
        if not up:
            raise
        raise FoldcarError(f"{what} takes longer than the limit of {limit_s:g} s") from None
    finally:
        inside = False
        signal.setitimer(signal.ITIMER_REAL, outer_s, outer_repeat_s)
        signal.signal(signal.SIGALRM, previous)
