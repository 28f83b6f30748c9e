"""What Ctrl-C, SIGTERM and SIGHUP (a closed terminal) do to a command: it ends with one line and exit code 130.

Each signal raises KeyboardInterrupt, so that what a command has begun is tidied up as after any exception. A library or
a Scenic program may suppress it: the process ends at the latest after GRACE_S, or at a second signal.
"""

import contextlib
import os
import signal
import threading
from collections.abc import Callable, Iterator
from types import FrameType

EXIT_CODE = 130
GRACE_S = 10.0
# Windows has no SIGHUP.
NUMBERS = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name))

_stopped = threading.Event()
_line = "foldcar: stopped"


def listen() -> None:
    """Handle the signals from now on; one that the caller ignores (nohup) stays ignored."""
    for number in NUMBERS:
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, _interrupt)


def stop_line() -> str | None:
    """What a command prints as it ends, if a signal has come."""
    return _line if _stopped.is_set() else None


@contextlib.contextmanager
def message_on_signal(line: Callable[[], str]) -> Iterator[None]:
    """If a signal ends the block, ``line`` gives what the command prints as it ends."""
    global _line
    try:
        yield
    except BaseException:
        # Tidying up may have raised another error in the place of KeyboardInterrupt.
        if _stopped.is_set():
            _line = line()
        raise


def _interrupt(number: int, frame: FrameType | None) -> None:
    if _stopped.is_set():
        _end()
    _stopped.set()
    timer = threading.Timer(GRACE_S, _end)
    timer.daemon = True
    timer.start()
    raise KeyboardInterrupt


def _end() -> None:
    with contextlib.suppress(OSError):
        os.write(2, f"{_line}\n".encode(errors="backslashreplace"))
    os._exit(EXIT_CODE)
