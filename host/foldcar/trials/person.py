"""The person beside the car: what they are told, what they type, and a live view of the drive.

Input: standard input, read by its descriptor, because the buffer of a Python file object would hide lines from `select`.
Output: lines, choices, keys; texts on standard output and error.
"""

import contextlib
import os
import select
import sys
import time
from collections.abc import Callable, Iterator
from typing import Any

from rich.console import Group
from rich.live import Live
from rich.progress_bar import ProgressBar
from rich.table import Table
from rich.text import Text

from foldcar.errors import FoldcarError
from foldcar.link.car import Car
from foldcar.shown_console import shown_console
from foldcar.trials.running import RunningTrial, telemetry

INPUT = 0
IDLE_S = 0.05
REFRESH_HZ = 10


def say(text: str) -> None:
    """Print a line."""
    print(text, flush=True)


def warn(error: object) -> None:
    """Print a line on standard error."""
    print(error, file=sys.stderr, flush=True)


class Answers:
    """Standard input by lines or by keys, while the link to the car is served: ``idle`` is called between letters."""

    def __init__(self, idle: Callable[[], None]) -> None:
        self._idle = idle
        self._typed = b""
        self.is_terminal = os.isatty(INPUT)

    def line(self, question: str) -> str:
        """Print ``question`` and return the typed line, stripped; FoldcarError at the end of input."""
        print(question, end="", flush=True)
        while b"\n" not in self._typed:
            if not select.select([INPUT], [], [], 0)[0]:
                self._idle()
                select.select([INPUT], [], [], IDLE_S)
                continue
            data = os.read(INPUT, 4096)
            if not data:
                say("")
                raise FoldcarError(f'no answer to "{question.strip()}": the input has ended; see `foldcar log --help`')
            self._typed += data
        line, _, self._typed = self._typed.partition(b"\n")
        typed = line.decode(errors="replace")
        if not self.is_terminal:
            # Echo the line of a script, as a terminal does.
            say(typed)
        return typed.strip()

    def choice(self, question: str, choices: dict[str, str], default: str | None) -> str:
        """Ask until the answer is a key or a value of ``choices``, or empty for the default; returns the value."""
        while True:
            typed = self.line(question).lower().replace("-", "_").replace(" ", "_")
            if not typed and default is not None:
                return default
            if choices.get(typed, typed) in choices.values():
                return choices.get(typed, typed)
            say(f"  type one of {', '.join(f'{key} ({value})' for key, value in choices.items())}")

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


class DriveView:
    """A :class:`foldcar.trials.driving.Watcher` that shows a drive on a terminal, and stops it on a key.

    ``pressed`` returns the last key pressed or None. Nothing is shown if the output is not a terminal; ``running`` is
    told all the same.
    """

    def __init__(
        self, time_limit_s: float, pressed: Callable[[], str | None], other_input: Any, running: RunningTrial
    ) -> None:
        self.other_input = other_input
        self.passed = False
        self._time_limit_s = time_limit_s
        self._pressed = pressed
        self._running = running
        self._shown_at_s = 0.0
        self._live = Live(console=shown_console(), transient=True, auto_refresh=False)

    def __enter__(self) -> "DriveView":
        if self._live.console.is_terminal:
            self._live.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._live.stop()

    def wants_stop(self) -> str | None:
        """The ending if a key was pressed that stops the drive, else None."""
        key = self._pressed()
        if key == "p":
            self.passed = True
            return "passed, said by key"
        return "stopped by key" if key in ("s", " ", "\n", "\r", "q", "\x1b") else None

    def look(self, car: Car) -> None:
        """Show the car's state at most REFRESH_HZ times a second."""
        self._running.show(car)
        now_s = time.monotonic()
        if self._live.is_started and now_s - self._shown_at_s >= 1 / REFRESH_HZ:
            self._shown_at_s = now_s
            self._live.update(self._panel(car), refresh=True)

    def _panel(self, car: Car) -> Group:
        now = telemetry(car)
        table = Table.grid(padding=(0, 2))
        bar = ProgressBar(total=self._time_limit_s, completed=min(now["elapsed_s"], self._time_limit_s), width=30)
        table.add_row("time", f"{now['elapsed_s']:6.1f} of {self._time_limit_s:g} s", bar)
        if now["pulses_us"] is not None:
            table.add_row("pulses", "µs", " ".join(f"{n}:{width}" for n, width in now["pulses_us"].items()) or "none")
        table.add_row("battery", "unreadable" if now["battery_v"] is None else f"{now['battery_v']:.2f} V", "")
        silent = f", silent for {now['silent_s']:.1f} s" if now["silent_s"] > 0.3 else ""
        packets = f"{now['received']} packets, {now['damaged']} damaged{silent}"
        table.add_row("link", f"{100 * now['lost']:.1f} % lost", packets)
        state, style = ("driving", "bold red") if now["driving"] else ("armed: stand clear", "bold yellow")
        return Group(Text(state, style=style), table, Text("p: it has passed   s, space: stop", style="dim"))
