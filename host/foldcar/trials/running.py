"""What a running `foldcar log` tells the store's live page: its trial, where things stand, the car's state.

Output: a JSON object in a file beside the store, replaced whole a few times a second and removed at the end. Who reads it
takes one that has not been replaced for some seconds as left by a killed program.
"""

import contextlib
import json
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from foldcar.car.body import CHANNELS
from foldcar.link.car import Car
from foldcar.store.log_files import running_trial_file

# Between two replacements (s).
PERIOD_S = 0.25


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
