"""Talks with the person beside the car: prints lines and reads answers.

Input: standard input, read by its descriptor, because the buffer of a Python file object would hide lines from `select`.
Output: lines, choices and keys; text on standard output and error.
"""

import contextlib
import os
import select
import sys
from collections.abc import Callable, Iterator, Mapping

from foldcar.errors import FoldcarError

INPUT = 0
IDLE_S = 0.05


def print_line(text: str) -> None:
    """Print a line."""
    print(text, flush=True)


def print_warning(error: object) -> None:
    """Print a line on standard error."""
    print(error, file=sys.stderr, flush=True)


class Answers:
    """Reads answers as lines or keys. While it waits, it calls ``idle``, which keeps the link to the car alive."""

    def __init__(self, idle: Callable[[], None]) -> None:
        self.is_terminal = os.isatty(INPUT)
        self._idle = idle
        self._typed = b""

    def line(self, question: str) -> str:
        """Print ``question`` and return the answer, stripped. Raises FoldcarError at the end of input."""
        print(question, end="", flush=True)
        while b"\n" not in self._typed:
            self._idle()
            if not select.select([INPUT], [], [], IDLE_S)[0]:
                continue
            data = os.read(INPUT, 4096)
            if not data:
                print_line("")
                raise FoldcarError(f'no answer to "{question.strip()}": the input has ended; see `foldcar log --help`')
            self._typed += data
        line, _, self._typed = self._typed.partition(b"\n")
        typed = line.decode(errors="replace")
        if not self.is_terminal:
            # Echo the line of a script, as a terminal does.
            print_line(typed)
        return typed.strip()

    def choice(self, question: str, choices: Mapping[str, str], default: str | None) -> str:
        """Ask until the answer is a key or a value of ``choices``, or empty for the default; returns the value."""
        while True:
            typed = self.line(question).lower().replace("-", "_").replace(" ", "_")
            if not typed and default is not None:
                return default
            if choices.get(typed, typed) in choices.values():
                return choices.get(typed, typed)
            print_line(f"  type one of {', '.join(f'{key} ({value})' for key, value in choices.items())}")

    @contextlib.contextmanager
    def keys(self) -> Iterator[Callable[[], str | None]]:
        """Yield a function that returns the last key pressed, or None, without waiting."""
        if not self.is_terminal:
            yield lambda: None
            return
        # These modules do not exist on Windows.
        import termios
        import tty

        before = termios.tcgetattr(INPUT)
        try:
            tty.setcbreak(INPUT)
            termios.tcflush(INPUT, termios.TCIFLUSH)
            yield _pressed
        finally:
            termios.tcflush(INPUT, termios.TCIFLUSH)
            termios.tcsetattr(INPUT, termios.TCSADRAIN, before)


def _pressed() -> str | None:
    if not select.select([INPUT], [], [], 0)[0]:
        return None
    return os.read(INPUT, 64)[-1:].decode(errors="replace") or None
