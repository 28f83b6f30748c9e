"""Drives one trial and writes the host's log of it; keys of a person may end the drive.

Input: a connected car, the settings of a run, a person's keys. Output: the log, and how the drive ended.
"""

import contextlib
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from foldcar.errors import FoldcarError
from foldcar.link.car import CarIdentity, ConnectedCar
from foldcar.link.parameters import read_parameters
from foldcar.link.stream import LinkLostError
from foldcar.link.tlog import LogError, TlogWriter
from foldcar.trials.drive_end import DriveEnd
from foldcar.trials.drive_view import DriveView
from foldcar.trials.driving import DRIVES_ON, drive
from foldcar.trials.faults import acknowledge_faults
from foldcar.trials.person import PersonAnswers, print_line
from foldcar.trials.plugged_car import require_same_car
from foldcar.trials.session_options import SessionOptions


def drive_with_log(
    car: ConnectedCar,
    answers: PersonAnswers,
    identity: CarIdentity,
    settings: Mapping[str, Any],
    trial: int,
    log: Path,
    view: DriveView,
    options: SessionOptions,
) -> DriveEnd:
    """Drive one trial, write its log, and return how it ended.

    Raises no FoldcarError: an error before the drive is in the result. Faults that the car has afterwards are
    acknowledged, so that the car can drive the next trial.
    """
    begins = "From the car's button on, it counts" if options.button else "Countdown"
    limit_s = settings["time_limit_s"]
    print_line(f"{begins} {options.countdown_s} s, then {limit_s:g} s at most. Ctrl-C stops.")
    try:
        with contextlib.closing(TlogWriter(log)) as log_writer:
            # Handle all messages that have arrived before, so that the log begins now.
            car.connection.catch_up()
            car.connection.log = log_writer
            # The answers to these requests put the car's identity and settings into the log.
            require_same_car(car, identity)
            for message in ("AUTOPILOT_VERSION", "SYS_STATUS"):
                car.request(message)
            read_parameters(car)
            with answers.keys() as pressed, view.watching(car, pressed):
                end = drive(car, settings, trial, options.countdown_s, view, options.untethered, options.button)
                end = replace(end, later_faults=_acknowledge_later_faults(car, end))
            # The person has pressed the key that says that the car has passed.
            if view.passed and end.outcome is None:
                end = replace(end, outcome="passed")
            return end
    except LinkLostError as error:
        return DriveEnd("link lost before the start", "aborted", None, error)
    except FoldcarError as error:
        return DriveEnd("not begun", "aborted", None, error)
    finally:
        car.connection.log = None


def _acknowledge_later_faults(car: ConnectedCar, end: DriveEnd) -> tuple[str, ...]:
    """Acknowledge the faults that the car has after a drive, if it is still connected, and return their lines.

    They belong to the trial, but do not change its outcome.
    """
    can_ask_car = end.ending != DRIVES_ON and not isinstance(end.error, (LinkLostError, LogError))
    if not can_ask_car:
        return ()
    try:
        return tuple(acknowledge_faults(car))
    except FoldcarError:
        return ()
