"""Simulates a person at a terminal: starts a command on a pseudo-terminal, waits for its output, types."""

import fcntl
import os
import pty
import re
import select
import struct
import termios
import time
from collections.abc import Callable
from pathlib import Path
from types import TracebackType
from typing import Any

from forked_foldcar import original

# Ends a test that hangs; far beyond what a busy machine makes of any step.
WAIT_S = 300.0
# Characters and lines of a terminal as it opens on most systems.
WIDTH, HEIGHT = 80, 24
COLOURS = re.compile(r"\x1b\[[0-9;?]*[A-Za-z]")


class Typist:
    """``with Typist(folder, "log", …) as person``; ``output`` is what the command has printed."""

    def __init__(self, folder: Path, *words: object) -> None:
        self._terminal, inner = pty.openpty()
        fcntl.ioctl(inner, termios.TIOCSWINSZ, struct.pack("HHHH", HEIGHT, WIDTH, 0, 0))
        self.output = ""
        self._read_to = 0
        environment = {**os.environ, "TERM": "xterm", "COLUMNS": str(WIDTH)}
        self.process = original().start([*map(str, words)], folder, environment, [inner] * 3)
        os.close(inner)

    def __enter__(self) -> "Typist":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.process.kill()
        self.process.wait()
        os.close(self._terminal)

    def sees(self, text: str) -> str:
        """Wait for ``text`` in the output after the last match; returns the output up to its end."""
        return self.sees_one_of(text)

    def sees_one_of(self, *texts: str) -> str:
        """Wait for the first of ``texts`` to appear; returns the output up to its end."""
        end_s = time.monotonic() + WAIT_S
        start = self._read_to
        while not any(text in self.output[start:] for text in texts):
            if not self._read(end_s - time.monotonic()):
                raise AssertionError(f"none of {texts} came, but {self.output[start:]}")
        self._read_to = min(self.output.index(text, start) + len(text) for text in texts if text in self.output[start:])
        return self.output[start : self._read_to]

    def watches_until(self, true: Callable[[], Any]) -> None:
        """Wait until ``true()``, reading on: a terminal that nobody reads holds the command up."""
        end_s = time.monotonic() + WAIT_S
        while not true():
            assert time.monotonic() < end_s, self.output
            self._read(0.02)

    def types(self, text: str) -> None:
        """Type ``text`` without adding a line end."""
        os.write(self._terminal, text.encode())

    def answers(self, *dialogue: tuple[str, str]) -> None:
        """Wait for each question in turn, and type its answer and Enter."""
        for question, answer in dialogue:
            self.sees(question)
            self.types(answer + "\n")

    def ends(self, timeout_s: float = WAIT_S) -> int:
        """Wait for the end of the command; returns its exit code."""
        end_s = time.monotonic() + timeout_s
        while self._read(max(0.1, end_s - time.monotonic())):
            pass
        return self.process.wait(timeout_s)

    def _read(self, timeout_s: float) -> bool:
        if timeout_s <= 0 or not select.select([self._terminal], [], [], timeout_s)[0]:
            return False
        try:
            data = os.read(self._terminal, 65536)
        except OSError:
            return False
        self.output += COLOURS.sub("", data.decode(errors="replace").replace("\r", ""))
        return bool(data)
