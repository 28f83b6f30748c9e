"""Answers a person types, while the link to the car goes on: lines for questions, single keys during a drive.

Reads standard input itself: a Python file object would hide typed lines from `select`.
"""

import contextlib
import os
import select
import sys
import termios
import tty
from collections.abc import Callable, Iterator

import typer

from foldcar.errors import FoldcarError

INPUT = 0
IDLE_S = 0.05


class TypedAnswers:
    """Standard input, line by line or key by key. ``idle`` is called whenever nothing is typed."""

    def __init__(self, idle: Callable[[], None]) -> None:
        self._idle = idle
        self._typed = b""
        self.is_terminal = os.isatty(INPUT)

    def line(self, question: str) -> str:
        """The line typed in answer to ``question``, without blanks around it; FoldcarError at the end of input."""
        typer.echo(question, nl=False)
        sys.stdout.flush()
        while b"\n" not in self._typed:
            if not select.select([INPUT], [], [], 0)[0]:
                self._idle()
                select.select([INPUT], [], [], IDLE_S)
                continue
            data = os.read(INPUT, 4096)
            if not data:
                typer.echo("")
                raise FoldcarError(f'no answer to "{question.strip()}": the input has ended; see `foldcar log --help`')
            self._typed += data
        line, _, self._typed = self._typed.partition(b"\n")
        if not self.is_terminal:
            # What a script types shows in its output like what a person types.
            typer.echo(line.decode(errors="replace"))
        return line.decode(errors="replace").strip()

    def choice(self, question: str, choices: dict[str, str], default: str | None) -> str:
        """One of the values of ``choices`` by its key or in full; asks until it is one."""
        while True:
            typed = self.line(question).lower().replace("-", "_").replace(" ", "_")
            if not typed and default is not None:
                return default
            if typed in choices:
                return choices[typed]
            if typed in choices.values():
                return typed
            typer.echo(f"  type one of {', '.join(f'{key} ({value})' for key, value in choices.items())}")

    @contextlib.contextmanager
    def keys(self) -> Iterator[Callable[[], str | None]]:
        """Gives a function for the key pressed last, if any, without waiting. No keys where input is no terminal."""
        if not self.is_terminal:
            yield lambda: None
            return
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
