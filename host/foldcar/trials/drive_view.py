"""Shows a drive on the terminal, at most REFRESH_HZ times a second, and reads the keys that end it."""

import contextlib
import time
from collections.abc import Callable, Iterator

from rich.console import Group
from rich.live import Live
from rich.table import Table
from rich.text import Text

from foldcar.car.body import CHANNELS
from foldcar.link.car import Car
from foldcar.shown_console import shown_console
from foldcar.trials.person import print_line

REFRESH_HZ = 10
PASSED, STOPS = "p", ("s", " ", "\n", "\r", "q", "\x1b")


class DriveView:
    """Shows a drive on a terminal, and stops it when a key is pressed.

    Nothing is shown if the output is not a terminal. The countdown begins with the first call of :meth:`update`.
    ``other_input`` is the descriptor of a file whose input ends the wait for messages early, or None.
    """

    def __init__(self, countdown_s: int, time_limit_s: float, other_input: int | None) -> None:
        self.other_input = other_input
        # Whether the person has said that the car has passed.
        self.passed = False
        # Whether the person was told to pull the cable.
        self._announced = False
        self._countdown_s, self._time_limit_s = countdown_s, time_limit_s
        self._pressed: Callable[[], str | None] = lambda: None
        self._begun_s: float | None = None
        self._shown_at_s = 0.0
        self._live = Live(console=shown_console(), transient=True, auto_refresh=False)

    @contextlib.contextmanager
    def watching(self, last_key: Callable[[], str | None]) -> Iterator[None]:
        """Show the drive during the block; ``last_key`` returns the last key pressed or None."""
        self._pressed = last_key
        if self._live.console.is_terminal:
            self._live.start()
        try:
            yield
        finally:
            self._live.stop()

    def wants_stop(self) -> str | None:
        """Return the ending if a key was pressed that stops the drive, else None."""
        key = self._pressed()
        if key == PASSED:
            self.passed = True
            return "passed, said by key"
        return "stopped by key" if key in STOPS else None

    def update(self, car: Car) -> None:
        """Show the car's state at most REFRESH_HZ times a second."""
        now_s = time.monotonic()
        self._begun_s = now_s if self._begun_s is None else self._begun_s
        self._announce(car)
        if self._live.is_started and now_s - self._shown_at_s >= 1 / REFRESH_HZ:
            self._shown_at_s = now_s
            self._live.update(self._panel(car, max(0.0, self._begun_s + self._countdown_s - now_s)), refresh=True)

    def _announce(self, car: Car) -> None:
        """Print once that the cable can be pulled, when the car itself counts or waits for its button."""
        trial, dialect = car.connection.latest.get("FOLDCAR_TRIAL"), car.dialect
        if self._announced or trial is None or not trial.flags & dialect.FOLDCAR_TRIAL_FLAGS_UNTETHERED:
            return
        if trial.state == dialect.FOLDCAR_STATE_COUNTING:
            print_line(f"Pull the cable now: the wheels start in {trial.countdown_ms / 1000:.0f} s.")
            self._announced = True
        elif trial.state == dialect.FOLDCAR_STATE_ARMED and car.is_under_way(trial):
            print_line(f"Pull the cable now, put the car in its place. Its button starts the {self._countdown_s} s.")
            self._announced = True

    def _panel(self, car: Car, remaining_s: float) -> Group:
        """Return what is shown: the car's last reported state, its pulses and battery, the quality of the link."""
        latest, link = car.connection.latest, car.connection
        trial, pulses, status = (latest.get(name) for name in ("FOLDCAR_TRIAL", "SERVO_OUTPUT_RAW", "SYS_STATUS"))
        headline = Text(f"ARMED    {remaining_s:5.1f} s  stand clear", style="bold yellow")
        if trial is not None and trial.state == car.dialect.FOLDCAR_STATE_COUNTING:
            headline = Text(f"COUNTING {trial.countdown_ms / 1000:5.1f} s  stand clear", style="bold yellow")
        elif trial is not None and trial.state == car.dialect.FOLDCAR_STATE_RUNNING:
            text = f"DRIVING  {trial.elapsed_ms / 1000:5.1f} s  {self._time_limit_s:g} s at most"
            headline = Text(text, style="bold red")
        table = Table.grid(padding=(0, 2))
        if pulses is not None:
            widths = {number: getattr(pulses, f"servo{number}_raw") for number in range(1, CHANNELS + 1)}
            table.add_row("pulses", f"{' '.join(f'{n}:{width}' for n, width in widths.items() if width) or 'none'} (µs)")
        volts = None if status is None or status.voltage_battery == 0xFFFF else status.voltage_battery / 1000
        table.add_row("battery", "unreadable" if volts is None else f"{volts:.2f} V")
        packets = link.received + link.lost
        loss_text = (
            f"{100 * link.lost / packets if packets else 0:.1f} % of {link.received} packets lost, {link.damaged} damaged"
        )
        table.add_row("link", f"{loss_text}, silent for {link.silence_s():.1f} s")
        return Group(headline, Text("p: it has passed   s, space: stop"), table)
