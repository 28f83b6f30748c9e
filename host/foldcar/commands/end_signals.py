"""Ends a command that holds a car or a simulator in an orderly way, whoever ends it."""

import signal
from types import FrameType


def end_like_ctrl_c() -> None:
    """From now on a request to end, or a terminal that is closed, is a KeyboardInterrupt."""
    for number in (signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, _interrupt)


def _interrupt(number: int, frame: FrameType | None) -> None:
    raise KeyboardInterrupt
