"""Ends a command with one line and exit code 130 at Ctrl-C, SIGTERM and SIGHUP (a closed terminal).

Each signal raises KeyboardInterrupt, so that the command cleans up as after any exception. If a library or a Scenic
program suppresses it, it is raised again. The process ends after GRACE_S at the latest, or at a second signal.
"""

import _thread
import contextlib
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from types import FrameType

EXIT_CODE = 130
# How long cleaning up may take, and the interval of repeated interrupts.
GRACE_S = 10.0
RETRY_S = 0.1
# Windows has no SIGHUP.
NUMBERS = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name))

_stopped = threading.Event()
# Set while this process interrupts its main thread again, so that this is not taken for a second signal of the user.
_repeating = threading.Event()
_last_line = "foldcar: stopped"


def handle_signals() -> None:
    """Start handling the signals; a signal that the caller ignores (nohup) stays ignored."""
    for number in NUMBERS:
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, _interrupt)
    sys.unraisablehook = _print_unraisable


def stop_line() -> str | None:
    """Return the line to print at the command's end if a signal was received, else None."""
    return _last_line if _stopped.is_set() else None


@contextlib.contextmanager
def message_on_signal(last_line: Callable[[], str]) -> Iterator[None]:
    """If a signal ends the block, keep the result of ``last_line``. The command prints it as its last line."""
    global _last_line
    try:
        yield
    except BaseException:
        # Cleaning up may have replaced KeyboardInterrupt by another exception, so ask whether a signal has come.
        if _stopped.is_set():
            _last_line = last_line()
        raise


def _interrupt(number: int, frame: FrameType | None) -> None:
    """Handle a signal: raise KeyboardInterrupt in the main thread, but not during an import.

    ``frame`` is what the main thread executes. The first signal of the user also starts a thread that sends this signal
    again and again, because its KeyboardInterrupt may be lost (see _repeat_interrupt). The second signal of the user
    ends the process at once.
    """
    is_sent_by_thread = _repeating.is_set()
    _repeating.clear()
    is_first = not _stopped.is_set()
    if is_first:
        _stopped.set()
        threading.Thread(target=_repeat_interrupt, args=(number,), daemon=True).start()
    elif not is_sent_by_thread:
        _end()
    # If an import were interrupted, it would leave a half-initialised module. The signal is repeated after the import.
    if not _imports(frame):
        raise KeyboardInterrupt


def _print_unraisable(unraisable: "sys.UnraisableHookArgs") -> None:
    """Print an exception that Python cannot raise, for example in a destructor.

    A KeyboardInterrupt is not printed, because _repeat_interrupt raises it again.
    """
    if not (_stopped.is_set() and unraisable.exc_type is KeyboardInterrupt):
        sys.__unraisablehook__(unraisable)


def _imports(frame: FrameType | None) -> bool:
    """Return whether the frame is part of an import. There, compiled modules print exceptions instead of raising them."""
    while frame is not None:
        if frame.f_code.co_filename.startswith("<frozen importlib"):
            return True
        frame = frame.f_back
    return False


def _repeat_interrupt(number: int) -> None:
    """Send signal ``number`` to the main thread every RETRY_S until the process ends. After GRACE_S, end the process.

    This is necessary because the first KeyboardInterrupt may be lost: it is not raised within an import, and libraries
    may suppress it. The signal is not sent while the main thread imports a module or handles an exception.
    """
    # The identifier is None only before a thread starts.
    main_thread = threading.main_thread().ident or 0
    for _ in range(round(GRACE_S / RETRY_S)):
        time.sleep(RETRY_S)
        if _handles_exception(main_thread) or _imports(sys._current_frames().get(main_thread)):
            continue
        _repeating.set()
        if hasattr(signal, "pthread_kill"):
            # This also interrupts a system call.
            signal.pthread_kill(main_thread, number)
        else:
            _thread.interrupt_main()
    _end()


def _handles_exception(thread: int) -> bool:
    """Return whether the thread with this identifier is in an `except` or a `finally` block because of an exception."""
    exception = sys._current_exceptions().get(thread)
    # If there is no exception, Python before 3.12 returns three times None instead.
    return exception is not None and exception != (None, None, None)


def _end() -> None:
    """Print the last line and end the process at once."""
    with contextlib.suppress(OSError):
        os.write(2, f"{_last_line}\n".encode(errors="backslashreplace"))
    os._exit(EXIT_CODE)
