"""Orderly end, on SIGTERM and SIGHUP, of a command that controls a car or a simulator."""

import signal
from types import FrameType


def end_like_ctrl_c() -> None:
    """Raise KeyboardInterrupt on SIGTERM and on SIGHUP (a closed terminal) from now on."""
    for number in (signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, _interrupt)


def _interrupt(number: int, frame: FrameType | None) -> None:
    raise KeyboardInterrupt
