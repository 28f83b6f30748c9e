"""The car's state while a trial is set up, driven and judged: on the terminal, and for the store's live page.

Input: a car's messages, keys. Output: lines on the terminal at most REFRESH_HZ times a second; for the page a JSON
object in a file beside the store, replaced whole a few times a second and removed at the end. Who reads it takes one that
has not been replaced for some seconds as left by a killed program.
"""

import contextlib
import json
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

from rich.console import Group
from rich.live import Live
from rich.table import Table
from rich.text import Text

from foldcar.car.body import CHANNELS
from foldcar.link.car import Car
from foldcar.shown_console import shown_console
from foldcar.store.log_files import running_trial_file
from foldcar.trials.person import STOP, Buttons

REFRESH_HZ = 10
# Between two replacements (s).
PERIOD_S = 0.25
PASSED = "p"
KEYS: Buttons = ((STOP, "Stop"), (PASSED, "It has passed"))


def telemetry(car: Car) -> dict[str, Any]:
    """The car's state as it last said it: null for what it has not said or cannot measure.

    ``driving``, ``elapsed_s`` (of the drive), ``pulses_us`` by servo output, ``battery_v``, ``roll_rad``, ``pitch_rad``;
    of the link ``lost`` (share of packets), ``received``, ``damaged`` (packets), ``silent_s``.
    """
    latest, link = car.connection.latest, car.connection
    trial, attitude = latest.get("FOLDCAR_TRIAL"), latest.get("ATTITUDE")
    pulses, status = latest.get("SERVO_OUTPUT_RAW"), latest.get("SYS_STATUS")
    running = car.dialect.FOLDCAR_STATE_RUNNING
    drive = trial if trial is not None and trial.state == running else None
    widths = {} if pulses is None else {n: getattr(pulses, f"servo{n}_raw") for n in range(1, CHANNELS + 1)}
    sent = link.received + link.lost
    return {
        "driving": drive is not None,
        "elapsed_s": 0.0 if drive is None else drive.elapsed_ms / 1000,
        "pulses_us": {n: width for n, width in widths.items() if width} if pulses is not None else None,
        "battery_v": None if status is None or status.voltage_battery == 0xFFFF else status.voltage_battery / 1000,
        "roll_rad": None if attitude is None else attitude.roll,
        "pitch_rad": None if attitude is None else attitude.pitch,
        "lost": link.lost / sent if sent else 0.0,
        "received": link.received,
        "damaged": link.damaged,
        "silent_s": link.silence_s(),
    }


class RunningTrial:
    """The file of a session. A disk that refuses it is no reason to end a trial: then the page shows none."""

    def __init__(self, store: Path) -> None:
        self._path = running_trial_file(store)
        self._said: dict[str, Any] = {}
        self._next_s = 0.0

    def begin(
        self, number: int, sample: int, car: str, time_limit_s: float, places: Sequence[Sequence[str]], moves: str
    ) -> None:  # fmt: skip
        """A trial: the placement's heads and rows are ``places``, what moves from where it stands ``moves``."""
        self._said = {
            "number": number, "sample": sample, "car": car, "time_limit_s": time_limit_s, "places": places,
            "moves": moves,
        }  # fmt: skip
        self._next_s = 0.0

    def show(self, car: Car | None, **more: Any) -> None:
        """Say the car's state, at most each PERIOD_S, and ``more`` of the trial from now on."""
        self._said |= more
        now_s = time.monotonic()
        if "number" not in self._said or now_s < self._next_s:
            return
        self._next_s = now_s + PERIOD_S
        said = {**self._said, "telemetry": None if car is None else telemetry(car)}
        with contextlib.suppress(OSError):
            self._path.parent.mkdir(exist_ok=True)
            beside = self._path.with_suffix(".part")
            beside.write_text(json.dumps(said), encoding="utf-8")
            beside.replace(self._path)

    def close(self) -> None:
        """Say no more."""
        self._said = {}
        with contextlib.suppress(OSError):
            self._path.unlink(missing_ok=True)


class DriveView:
    """Shows a drive on a terminal, and stops it on a key.

    Nothing is shown if the output is not a terminal; ``running`` is told all the same. The countdown begins with the
    first look. ``other_input`` is a file whose input ends the wait for messages early, or None.
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
        head = Text(f"ARMED    {left_s:5.1f} s  stand clear", style="bold yellow")
        if now["driving"]:
            head = Text(f"DRIVING  {now['elapsed_s']:5.1f} s  {self._time_limit_s:g} s at most", style="bold red")
        table = Table.grid(padding=(0, 2))
        if now["pulses_us"] is not None:
            pulses = " ".join(f"{n}:{width}" for n, width in now["pulses_us"].items())
            table.add_row("pulses", f"{pulses or 'none'} (µs)")
        table.add_row("battery", "unreadable" if now["battery_v"] is None else f"{now['battery_v']:.2f} V")
        lost = f"{100 * now['lost']:.1f} % of {now['received']} packets lost, {now['damaged']} damaged"
        table.add_row("link", f"{lost}, silent for {now['silent_s']:.1f} s")
        return Group(head, Text("p: it has passed   s, space: stop"), table)
