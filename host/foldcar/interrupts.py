"""What Ctrl-C, SIGTERM and SIGHUP (a closed terminal) do to a command: one line on standard error, exit code 130.

The process ends inside the signal's handler. Nothing is raised, because imports, destructors and Scenic programs swallow
exceptions. What a killed process would leave behind is named by `held` and tidied up first; only blocks in `raised`, in
which a car may drive, get a KeyboardInterrupt. `listen` must come before all slow imports, so this file has none.
"""

import os
import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from types import FrameType
from typing import TypeVar

from foldcar.shown_text import shown

EXIT_CODE = 130
# Windows has no SIGHUP, and no fork and no masks either.
NUMBERS = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name))

_Entry = TypeVar("_Entry")

_tidies: list[Callable[[], object]] = []
_lines: list[Callable[[], str]] = [lambda: "foldcar: stopped"]
_raises: list[bool] = [False]
_delays = 0
_pending = False
_listening = False


def listen() -> None:
    """Handle the signals from now on; one that the caller ignores (nohup) stays ignored."""
    global _listening
    if _listening:
        return
    _listening = True
    for number in NUMBERS:
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, _interrupt)
    if hasattr(os, "register_at_fork"):
        os.register_at_fork(after_in_child=_leave_them_to_the_parent)


@contextmanager
def held(tidy: Callable[[], object]) -> Iterator[None]:
    """``tidy`` is called if a signal ends the process within the block. At the block's end the caller tidies up."""
    with _within(_tidies, tidy):
        yield


@contextmanager
def said(line: Callable[[], str]) -> Iterator[None]:
    """``line`` gives what a signal within the block makes the process say as it ends."""
    with _within(_lines, line):
        yield


@contextmanager
def _within(entries: list[_Entry], entry: _Entry) -> Iterator[None]:
    entries.append(entry)
    try:
        yield
    finally:
        entries.remove(entry)


@contextmanager
def raised() -> Iterator[None]:
    """A signal within the block raises KeyboardInterrupt there; the process ends after the block, swallowed or not."""
    global _pending
    _raises.append(True)
    try:
        yield
    except KeyboardInterrupt:
        if not _listening:
            raise
        _pending = True
    finally:
        _raises.pop()
        if _pending:
            leave()


@contextmanager
def at_once() -> Iterator[None]:
    """Within `raised`, a block that would swallow a KeyboardInterrupt: a signal ends the process there."""
    _raises.append(False)
    try:
        if _pending:
            leave()
        yield
    finally:
        _raises.pop()


@contextmanager
def delayed() -> Iterator[None]:
    """A signal within the block, which must be short, has its effect at the block's end."""
    global _delays
    _delays += 1
    try:
        yield
    finally:
        _delays -= 1
        if _pending and _delays == 0:
            _obey()


def is_pending() -> bool:
    """Whether a signal waits for the end of a `delayed` block, which is then to end soon."""
    return _pending


def leave() -> None:
    """Tidy up, say it and end the process."""
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_BLOCK, NUMBERS)
    for tidy in reversed(_tidies):
        with suppress(Exception):
            tidy()
    with suppress(OSError):
        line = f"{shown(_lines[-1]())}\n".encode(getattr(sys.__stderr__, "encoding", "utf-8"), "backslashreplace")
        os.write(sys.__stderr__.fileno() if sys.__stderr__ else 2, line)
    os._exit(EXIT_CODE)


def _interrupt(number: int, frame: FrameType | None) -> None:
    global _pending
    _pending = True
    if _delays == 0:
        _obey()


def _obey() -> None:
    if _raises[-1]:
        raise KeyboardInterrupt
    leave()


def _leave_them_to_the_parent() -> None:
    """In a forked process: Ctrl-C is the parent's business, which ends its children; other signals end the child."""
    for number in NUMBERS:
        if signal.getsignal(number) is _interrupt:
            signal.signal(number, signal.SIG_IGN if number == signal.SIGINT else signal.SIG_DFL)
