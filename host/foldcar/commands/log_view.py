"""The live view of a drive on a terminal: time, pulses, battery, link quality."""

import time
from collections.abc import Callable
from typing import Any

from rich.console import Group
from rich.live import Live
from rich.progress_bar import ProgressBar
from rich.table import Table
from rich.text import Text

from foldcar.car.body import CHANNELS
from foldcar.link.car import Car
from foldcar.shown_console import shown_console

REFRESH_HZ = 10


class LogView:
    """A :class:`foldcar.trials.driving.Watcher` that displays a drive and stops it on a key.

    ``pressed`` returns the last key pressed or None. Nothing is displayed if the output is not a terminal.
    """

    def __init__(self, time_limit_s: float, pressed: Callable[[], str | None], other_input: Any) -> None:
        self.other_input = other_input
        self.passed = False
        self._time_limit_s = time_limit_s
        self._pressed = pressed
        self._console = shown_console()
        self._shown_at_s = 0.0
        self._live = Live(console=self._console, refresh_per_second=REFRESH_HZ, transient=True, auto_refresh=False)

    def __enter__(self) -> "LogView":
        if self._console.is_terminal:
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
        """Display the car's state at most REFRESH_HZ times a second."""
        now_s = time.monotonic()
        if self._live.is_started and now_s - self._shown_at_s >= 1 / REFRESH_HZ:
            self._shown_at_s = now_s
            self._live.update(self._panel(car), refresh=True)

    def _panel(self, car: Car) -> Group:
        latest, connection = car.connection.latest, car.connection
        trial = latest.get("FOLDCAR_TRIAL")
        running = trial is not None and trial.state == car.dialect.FOLDCAR_STATE_RUNNING
        elapsed_s = trial.elapsed_ms / 1000 if trial is not None and running else 0.0
        table = Table.grid(padding=(0, 2))
        table.add_row("time", f"{elapsed_s:6.1f} of {self._time_limit_s:g} s", _bar(elapsed_s, self._time_limit_s))
        pulses = latest.get("SERVO_OUTPUT_RAW")
        if pulses is not None:
            widths = [getattr(pulses, f"servo{n}_raw") for n in range(1, CHANNELS + 1)]
            shown = " ".join(f"{n}:{width}" for n, width in enumerate(widths, 1) if width) or "none"
            table.add_row("pulses", "µs", shown)
        volts = car_voltage(car)
        table.add_row("battery", "unreadable" if volts is None else f"{volts:.2f} V", "")
        sent = connection.received + connection.lost
        lost = 100 * connection.lost / sent if sent else 0.0
        silent = f", silent for {connection.silence_s():.1f} s" if connection.silence_s() > 0.3 else ""
        packets = f"{connection.received} packets, {connection.damaged} damaged{silent}"
        table.add_row("link", f"{lost:.1f} % lost", packets)
        state = "driving" if running else "armed: stand clear"
        return Group(Text(state, style="bold red" if running else "bold yellow"), table,
                     Text("p: it has passed   s, space: stop", style="dim"))  # fmt: skip


def car_voltage(car: Car) -> float | None:
    """Battery voltage (V) as last reported, None if unknown; sends no request to the car."""
    status = car.connection.latest.get("SYS_STATUS")
    return None if status is None or status.voltage_battery == 0xFFFF else status.voltage_battery / 1000


def _bar(elapsed_s: float, limit_s: float) -> ProgressBar:
    return ProgressBar(total=limit_s, completed=min(elapsed_s, limit_s), width=30)
