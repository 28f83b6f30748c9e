"""Talks with the person beside the car: prints lines and reads answers.

Input: standard input. Output: lines, choices and keys; text on standard output and error.
"""

import contextlib
import sys
from collections.abc import Callable, Mapping

from foldcar.errors import FoldcarError
from foldcar.system import TypedInput

IDLE_S = 0.05


def print_line(text: str) -> None:
    """Print a line."""
    print(text, flush=True)


def print_warning(error: object) -> None:
    """Print a line on standard error."""
    print(error, file=sys.stderr, flush=True)


class PersonAnswers:
    """Reads answers as lines or keys. While it waits, it calls ``idle``, which keeps the link to the car alive.

    ``waitable`` is a descriptor for `select` that reports keys, or None.
    """

    def __init__(self, idle: Callable[[], None]) -> None:
        self._input = TypedInput()
        self.is_terminal, self.waitable = self._input.is_terminal, self._input.waitable
        self._idle = idle
        self._typed = b""

    def line(self, question: str) -> str:
        """Print ``question`` and return the answer, stripped. Raises FoldcarError at the end of input."""
        print(question, end="", flush=True)
        while b"\n" not in self._typed:
            self._idle()
            received = self._input.read(IDLE_S)
            if received is None:
                continue
            if not received:
                print_line("")
                raise FoldcarError(f'no answer to "{question.strip()}": the input has ended')
            self._typed += received
        line, _, self._typed = self._typed.partition(b"\n")
        answer = line.decode(errors="replace")
        if not self.is_terminal:
            # Echo the line of a script, as a terminal does.
            print_line(answer)
        return answer.strip()

    def choice(self, question: str, choices: Mapping[str, str], default: str | None) -> str:
        """Ask until the answer is a key or a value of ``choices``, and return the value.

        An empty answer means ``default``, if there is one.
        """
        while True:
            answer = self.line(question).lower().replace("-", "_").replace(" ", "_")
            if not answer and default is not None:
                return default
            value = choices.get(answer, answer)
            if value in choices.values():
                return value
            listed = ", ".join(f"{key} ({value})" for key, value in choices.items())
            print_line(f"  type one of {listed}")

    def keys(self) -> contextlib.AbstractContextManager[Callable[[], str | None]]:
        """Return a context manager that yields a function: it returns the last key pressed, or None, without waiting."""
        return self._input.keys()
