"""The person beside the car: what they are told, what they type here or tap on the store's page.

Input: standard input, read by its descriptor, because the buffer of a Python file object would hide lines from `select`;
a pipe of taps, a JSON object a line: ``question`` (its number) and ``answer``. Output: lines, choices, keys; texts on
standard output and error.
"""

import contextlib
import json
import os
import select
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

from foldcar.errors import FoldcarError

INPUT = 0
IDLE_S = 0.05
# What stops a drive, also when it was tapped before the page knew that the car drives.
STOP = "s"
# Of questions: answers and what the page's buttons say.
Buttons = Sequence[tuple[str, str]]


def say(text: str) -> None:
    """Print a line."""
    print(text, flush=True)


def warn(error: object) -> None:
    """Print a line on standard error."""
    print(error, file=sys.stderr, flush=True)


class Answers:
    """Answers by lines or by keys, while the link to the car is served: ``idle`` is called between letters.

    ``taps`` is the pipe's descriptor. A tap answers the question that its page showed, or none: a late one, or a second
    one, must not answer the next. ``question`` is the one that is asked now, for the page: its number, text and buttons.
    """

    def __init__(self, idle: Callable[[], None], taps: int | None = None) -> None:
        self.is_terminal = os.isatty(INPUT)
        self.question: dict[str, Any] | None = None
        self._idle = idle
        self._taps = taps
        self._typed = self._tapped = b""
        self._asked = 0

    def line(self, question: str, buttons: Buttons = ()) -> str:
        """Print ``question`` and return the answer, stripped; FoldcarError at the end of input."""
        print(question, end="", flush=True)
        with self._asking(question, buttons):
            while (answer := self._line(question)) is None and (answer := self._tap()) is None:
                self._idle()
                select.select([INPUT, *([] if self._taps is None else [self._taps])], [], [], IDLE_S)
        return answer

    def choice(self, question: str, choices: Mapping[str, str], default: str | None) -> str:
        """Ask until the answer is a key or a value of ``choices``, or empty for the default; returns the value."""
        buttons = [(value, value.replace("_", " ")) for value in choices.values()]
        while True:
            typed = self.line(question, buttons).lower().replace("-", "_").replace(" ", "_")
            if not typed and default is not None:
                return default
            if choices.get(typed, typed) in choices.values():
                return choices.get(typed, typed)
            say(f"  type one of {', '.join(f'{key} ({value})' for key, value in choices.items())}")

    @contextlib.contextmanager
    def keys(self, buttons: Buttons) -> Iterator[Callable[[], str | None]]:
        """Within the block, a function that returns the last key pressed or tapped, or None, without waiting."""
        with self._asking("", buttons), self._raw() as pressed:
            yield lambda: self._tap(STOP) or pressed()

    @contextlib.contextmanager
    def _raw(self) -> Iterator[Callable[[], str | None]]:
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

    @contextlib.contextmanager
    def _asking(self, text: str, buttons: Buttons) -> Iterator[None]:
        self._asked += 1
        self.question = {"number": self._asked, "text": text, "buttons": buttons}
        try:
            yield
        finally:
            self.question = None

    def _line(self, question: str) -> str | None:
        if b"\n" not in self._typed and select.select([INPUT], [], [], 0)[0]:
            data = os.read(INPUT, 4096)
            if not data:
                say("")
                raise FoldcarError(f'no answer to "{question.strip()}": the input has ended; see `foldcar log --help`')
            self._typed += data
        if b"\n" not in self._typed:
            return None
        line, _, self._typed = self._typed.partition(b"\n")
        typed = line.decode(errors="replace")
        if not self.is_terminal:
            # Echo the line of a script, as a terminal does.
            say(typed)
        return typed.strip()

    def _tap(self, always: str | None = None) -> str | None:
        """The answer that was tapped to the question of now; ``always`` is one to whatever question."""
        while self._taps is not None and select.select([self._taps], [], [], 0)[0]:
            data = os.read(self._taps, 4096)
            self._tapped += data
            if not data:
                self._taps = None
        *lines, self._tapped = self._tapped.split(b"\n")
        for tap in map(json.loads, lines):
            if tap["question"] == self._asked or tap["answer"] == always:
                if always is None:
                    say(f"{tap['answer']}  (tapped)")
                return str(tap["answer"]).strip()
        return None


def _pressed() -> str | None:
    if not select.select([INPUT], [], [], 0)[0]:
        return None
    return os.read(INPUT, 64)[-1:].decode(errors="replace") or None
