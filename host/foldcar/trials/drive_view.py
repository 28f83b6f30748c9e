"""Shows a drive on the terminal, and reads the keys that end it.

A thread of its own shows the drive, because a terminal may block for any time (Ctrl-S, text marked in a Windows console,
a hanging connection). The keys are read, and the car is stopped, without waiting for the terminal.
"""

import contextlib
import os
import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from typing import TextIO

from rich.console import Group
from rich.live import Live
from rich.table import Table
from rich.text import Text

from foldcar.car.body import CHANNELS
from foldcar.link.car import ConnectedCar
from foldcar.shown_console import shown_console
from foldcar.statistics.words import percent

REFRESH_S = 0.1
# MAVLink's SYS_STATUS.voltage_battery (mV) if the voltage is unknown.
UNKNOWN_VOLTAGE = 0xFFFF
PASSED, STOPS = "p", ("s", " ", "\n", "\r", "q", "\x1b")


class DriveView:
    """Shows a drive on a terminal, and reads the keys that stop it.

    Without a terminal only its lines are printed, such as that about the cable. ``other_input`` is the descriptor of a
    file whose input ends the wait for messages early, or None.
    """

    def __init__(self, countdown_s: int, time_limit_s: float, other_input: int | None) -> None:
        # The descriptor of a further input whose data end the waiting for messages, or None.
        self.other_input = other_input
        # Whether the person has said that the car has passed.
        self.passed = False
        self._countdown_s, self._time_limit_s = countdown_s, time_limit_s
        self._pressed: Callable[[], str | None] = lambda: None
        # When the countdown has begun (s, monotonic); None before.
        self._begun_s: float | None = None
        # Whether the car was seen driving.
        self._has_driven = False
        # Lines that wait to be shown.
        self._lines: deque[str] = deque()
        self._ended = threading.Event()
        self._thread: threading.Thread | None = None

    @contextlib.contextmanager
    def watching(self, car: ConnectedCar, last_key: Callable[[], str | None]) -> Iterator[None]:
        """Show the drive during the block; ``last_key`` returns the last key pressed or None.

        The end of the block does not wait for the terminal; :meth:`wait_for_terminal` does.
        """
        self._pressed = last_key
        # A daemon, because a terminal that stays blocked must not keep the program from ending.
        self._thread = threading.Thread(target=self._show, args=(car,), daemon=True)
        self._thread.start()
        try:
            yield
        finally:
            self._ended.set()

    def wait_for_terminal(self) -> None:
        """Wait until all of the drive is shown, so that the next line does not mix with it."""
        if self._thread is not None:
            self._thread.join()

    def tell(self, line: str) -> None:
        """Show a line above the drive."""
        self._lines.append(line)

    def begin(self) -> None:
        """Show the drive from now on; the countdown begins, if there is one."""
        self._begun_s = time.monotonic()

    def wants_stop(self) -> str | None:
        """Return how the drive ends if the person has pressed a key that stops it, otherwise None."""
        key = self._pressed()
        if key == PASSED:
            self.passed = True
            return "passed, said by key"
        return "stopped by key" if key in STOPS else None

    def _show(self, car: ConnectedCar) -> None:
        """Show the car's state every REFRESH_S until the drive has ended.

        A thread of its own runs this. It also prints the lines that wait to be shown and, once, when to pull the cable.
        """
        # If the terminal is closed, nothing is shown.
        with contextlib.suppress(OSError), _own_standard_output() as file:
            console = shown_console(file=file)
            live = Live(console=console, transient=True, auto_refresh=False, redirect_stdout=False, redirect_stderr=False)
            has_announced = False
            with live if console.is_terminal else contextlib.nullcontext():
                while not self._ended.wait(REFRESH_S):
                    announcement = None if has_announced else self._announcement(car)
                    if announcement is not None:
                        self._lines.append(announcement)
                        has_announced = True
                    while self._lines:
                        console.print(self._lines.popleft(), soft_wrap=True)
                        file.flush()
                    if console.is_terminal and self._begun_s is not None:
                        countdown_end_s = self._begun_s + self._countdown_s
                        remaining_s = max(0.0, countdown_end_s - time.monotonic())
                        live.update(self._panel(car, remaining_s), refresh=True)

    def _announcement(self, car: ConnectedCar) -> str | None:
        """Return a line that tells the person to pull the cable; None if the car does not yet drive by itself.

        An untethered car needs no cable from the moment on at which it counts down or waits for its button.
        """
        trial, dialect = car.connection.latest.get("FOLDCAR_TRIAL"), car.dialect
        if trial is None:
            return None
        is_untethered = trial.flags & dialect.FOLDCAR_TRIAL_FLAGS_UNTETHERED
        if not is_untethered:
            return None
        if trial.state == dialect.FOLDCAR_STATE_COUNTING:
            return f"Pull the cable now: the wheels start in {trial.countdown_ms / 1000:.0f} s."
        # A car that is armed, but not told to start, is not under way.
        waits_for_button = trial.state == dialect.FOLDCAR_STATE_ARMED and car.is_under_way(trial)
        if waits_for_button:
            return f"Pull the cable now, put the car in its place. Its button starts the {self._countdown_s} s."
        return None

    def _panel(self, car: ConnectedCar, remaining_s: float) -> Group:
        """Return what is shown: the car's last reported state, its pulses and battery, the quality of the link."""
        link = car.connection
        pulses, status = link.latest.get("SERVO_OUTPUT_RAW"), link.latest.get("SYS_STATUS")
        table = Table.grid(padding=(0, 2))
        if pulses is not None:
            widths_us = {number: getattr(pulses, f"servo{number}_raw") for number in range(1, CHANNELS + 1)}
            # An output without a pulse has the width 0.
            texts = [f"{number}:{width_us}" for number, width_us in widths_us.items() if width_us]
            pulses_text = " ".join(texts) or "none"
            table.add_row("pulses", f"{pulses_text} (µs)")
        if status is None or status.voltage_battery == UNKNOWN_VOLTAGE:
            table.add_row("battery", "unreadable")
        else:
            table.add_row("battery", f"{status.voltage_battery / 1000:.2f} V")
        packet_count = link.received + link.lost
        lost = percent(link.lost / packet_count if packet_count else 0, 1)
        loss_text = f"{lost} of {packet_count} packets lost, {link.damaged} damaged"
        table.add_row("link", f"{loss_text}, silent for {link.silence_s():.1f} s")
        return Group(self._headline(car, remaining_s), Text("p: it has passed   s, space: stop"), table)

    def _headline(self, car: ConnectedCar, remaining_s: float) -> Text:
        """Return the car's last reported state with its time; ``remaining_s`` is that of the host's countdown."""
        trial, dialect = car.connection.latest.get("FOLDCAR_TRIAL"), car.dialect
        state = None if trial is None else trial.state
        if trial is not None and state == dialect.FOLDCAR_STATE_COUNTING:
            return Text(f"COUNTING {trial.countdown_ms / 1000:5.1f} s  stand clear", style="bold yellow")
        if trial is not None and state == dialect.FOLDCAR_STATE_RUNNING:
            self._has_driven = True
            time_text = f"{trial.elapsed_ms / 1000:5.1f} s  {self._time_limit_s:g} s at most"
            return Text(f"DRIVING  {time_text}", style="bold red")
        # The host disarms a car that has ended.
        if self._has_driven or state in (dialect.FOLDCAR_STATE_FINISHED, dialect.FOLDCAR_STATE_FAULT):
            return Text("ENDED")
        return Text(f"ARMED    {remaining_s:5.1f} s  stand clear", style="bold yellow")


def _own_standard_output() -> TextIO:
    """Open standard output once more, as a file object of its own, which must be closed.

    A write to a blocked terminal holds the lock of its file object. Other threads can still print to theirs.
    """
    return os.fdopen(os.dup(sys.stdout.fileno()), "w", encoding=sys.stdout.encoding)
