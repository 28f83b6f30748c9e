"""Reads a person's answers while the link to the car is served: lines for questions, single keys during a drive.

Input: standard input, read by its descriptor, because the buffer of a Python file object would hide lines from
`select`. Output: lines, choices, keys.
"""

import contextlib
import os
import select
import sys
from collections.abc import Callable, Iterator

import typer

from foldcar.errors import FoldcarError

INPUT = 0
IDLE_S = 0.05


class TypedAnswers:
    """Standard input by lines or by keys. ``idle`` is called repeatedly while nothing is typed."""

    def __init__(self, idle: Callable[[], None]) -> None:
        self._idle = idle
        self._typed = b""
        self.is_terminal = os.isatty(INPUT)

    def line(self, question: str) -> str:
        """Print ``question`` and return the typed line, stripped; FoldcarError at the end of input."""
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
            # Echo the line of a script, as a terminal does.
            typer.echo(line.decode(errors="replace"))
        return line.decode(errors="replace").strip()

    def choice(self, question: str, choices: dict[str, str], default: str | None) -> str:
        """Ask until the answer is a key or a value of ``choices``, or empty for the default; returns the value."""
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
        """Within the block, a function that returns the last key pressed, or None, without waiting.

        It returns None always if the input is not a terminal.
        """
        if not self.is_terminal:
            yield lambda: None
            return
        # Not on Windows.
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
