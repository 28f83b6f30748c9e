"""A live view of a drive on the terminal, in letters that are read from a few steps away.

Input: a car's messages, keys. Output: the state, the seconds, the link, at most REFRESH_HZ times a second.
"""

import contextlib
import time
from collections.abc import Callable, Iterator
from typing import Any

from rich.console import Group
from rich.live import Live
from rich.table import Table
from rich.text import Text

from foldcar.link.car import Car
from foldcar.shown_console import shown_console
from foldcar.trials.person import STOP, Buttons
from foldcar.trials.running import RunningTrial, telemetry

REFRESH_HZ = 10
PASSED = "p"
KEYS: Buttons = ((STOP, "Stop"), (PASSED, "It has passed"))
# Letters of 3 × 5 points: an octal digit is a row, its highest bit at the left.
LETTERS = {
    "A": "25755", "D": "65556", "E": "74647", "G": "34553", "I": "72227", "M": "57755", "N": "65555", "R": "65655",
    "V": "55552", "0": "75557", "1": "26227", "2": "71747", "3": "71717", "4": "55711", "5": "74717", "6": "74757",
    "7": "71111", "8": "75757", "9": "75717", ".": "00002", " ": "00000",
}  # fmt: skip


def large(text: str) -> str:
    """Five lines of blocks, eight columns a letter, for a text of LETTERS."""
    rows = []
    for row in range(5):
        points = [f"{int(LETTERS[letter][row], 8):03b}" for letter in text]
        rows.append(" ".join("".join("██" if point == "1" else "  " for point in three) + " " for three in points))
    return "\n".join(rows)


class DriveView:
    """A :class:`foldcar.trials.driving.Watcher` that shows a drive on a terminal, and stops it on a key.

    Nothing is shown if the output is not a terminal; ``running`` is told all the same. The countdown begins with the
    first look.
    """

    def __init__(self, countdown_s: int, time_limit_s: float, other_input: Any, running: RunningTrial) -> None:
        self.other_input = other_input
        self.passed = False
        self._countdown_s, self._time_limit_s = countdown_s, time_limit_s
        self._pressed: Callable[[], str | None] = lambda: None
        self._running = running
        self._begun_s: float | None = None
        self._shown_at_s = 0.0
        self._live = Live(console=shown_console(), transient=True, auto_refresh=False)

    @contextlib.contextmanager
    def watching(self, pressed: Callable[[], str | None]) -> Iterator[None]:
        """Within the block, ``pressed`` gives the last key pressed or None."""
        self._pressed = pressed
        if self._live.console.is_terminal:
            self._live.start()
        try:
            yield
        finally:
            self._live.stop()

    def wants_stop(self) -> str | None:
        """The ending if a key was pressed that stops the drive, else None."""
        key = self._pressed()
        if key == PASSED:
            self.passed = True
            return "passed, said by key"
        return "stopped by key" if key in (STOP, " ", "\n", "\r", "q", "\x1b") else None

    def look(self, car: Car) -> None:
        """Show the car's state at most REFRESH_HZ times a second."""
        now_s = time.monotonic()
        self._begun_s = now_s if self._begun_s is None else self._begun_s
        left_s = max(0.0, self._begun_s + self._countdown_s - now_s)
        self._running.show(car, countdown_s=round(left_s, 1))
        if self._live.is_started and now_s - self._shown_at_s >= 1 / REFRESH_HZ:
            self._shown_at_s = now_s
            self._live.update(self._panel(telemetry(car), left_s), refresh=True)

    def _panel(self, now: dict[str, Any], left_s: float) -> Group:
        state, style, seconds_s = ("DRIVING", "bold red", now["elapsed_s"])
        if not now["driving"]:
            state, style, seconds_s = ("ARMED", "bold yellow", left_s)
        table = Table.grid(padding=(0, 2))
        if now["pulses_us"] is not None:
            table.add_row("pulses", "µs", " ".join(f"{n}:{width}" for n, width in now["pulses_us"].items()) or "none")
        table.add_row("battery", "unreadable" if now["battery_v"] is None else f"{now['battery_v']:.2f} V", "")
        silent = f", silent for {now['silent_s']:.1f} s" if now["silent_s"] > 0.3 else ""
        packets = f"{now['received']} packets, {now['damaged']} damaged{silent}"
        table.add_row("link", f"{100 * now['lost']:.1f} % lost", packets)
        words = f"driving, {self._time_limit_s:g} s at most" if now["driving"] else "armed: stand clear"
        big = (Text(large(text), style=style) for text in (state, f"{seconds_s:.1f}"))
        return Group(*big, Text(f"{words}   p: it has passed   s, space: stop"), table)
