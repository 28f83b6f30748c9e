"""Drives a car through one trial: arm, start, watch, stop. The car is stopped after every error.

Input: a connected car and the settings of a run (docs/carsim.md). Output: how the drive ended, and its outcome if it is
known. This module neither asks nor prints.
"""

import contextlib
import math
import time
from collections.abc import Mapping
from typing import Any

from foldcar.errors import FoldcarError
from foldcar.link.car import CommandRefusedError, ConnectedCar
from foldcar.link.stream import LinkLostError
from foldcar.link.tlog import LogError
from foldcar.trials.cars_log import STORING_S, wait_for_storage
from foldcar.trials.drive_end import (
    DriveEnd,
    car_ended,
    car_restarted,
    is_of_trial,
    pace_hint,
    simulated_outcome,
)
from foldcar.trials.drive_view import DriveView
from foldcar.trials.faults import CarFaultError, fault_line

# A car that is silent for so long is lost. If this program stands still for so long, it was stopped (Ctrl-Z).
SILENCE_S = 2.0
AFTERWARDS_S = 0.3
# Ending of an untethered drive: the cable is unplugged and the car drives on.
DRIVES_ON = "drives on untethered"
STILL_PLUGGED_IN = "the cable was still plugged in when the wheels started"
CTRL_C = "Ctrl-C"
STOOD_STILL = "this program stood still"
STEP_S = 0.05
# A simulated car's clock may run slower than the host's by at most this factor.
MAX_DELAY = 20.0


def drive(
    car: ConnectedCar,
    settings: Mapping[str, Any],
    trial: int,
    countdown_s: int,
    view: DriveView,
    untethered: bool = False,
    button: bool = False,
) -> DriveEnd:
    """Drive one trial. Errors of car, cable and disk, and Ctrl-C, are returned in the result instead of raised.

    ``settings`` has ``speed_m_s``, ``yaw_rate_rad_s`` and ``time_limit_s``. For an ``untethered`` drive the car itself
    counts down, with ``button`` from the moment at which its button is pressed. When its cable is unplugged, the result
    is DRIVES_ON and the car is not stopped.
    """
    end = None
    try:
        end = _drive_to_end(car, settings, trial, countdown_s, view, untethered, button)
    finally:
        if end is None or end.ending != DRIVES_ON:
            _stand_still(car)
    return end


def _drive_to_end(
    car: ConnectedCar,
    settings: Mapping[str, Any],
    trial: int,
    countdown_s: int,
    view: DriveView,
    untethered: bool,
    button: bool,
) -> DriveEnd:
    """Drive one trial as :func:`drive`, but leave the car as it is at the end."""
    started = False

    def elapsed_s() -> float | None:
        """Return the trial's time (s) as the car reported it last; None before the start."""
        # Before the start, the car reports its last trial, which may have had the same number in another store.
        return _elapsed_s(car, trial) if started else None

    try:
        with contextlib.suppress(CommandRefusedError):
            # End an earlier drive. If the car's state forbids driving, arming fails with the reason.
            car.stop_trial()
        # Until its flash is ready for the next log, the car refuses to start.
        wait_for_storage(car, view.tell)
        car.arm()
        early_ending = None if untethered else _count_down(car, countdown_s, view)
        if early_ending is not None:
            return DriveEnd(f"{early_ending} before the start", "aborted", None)
        if car.connection.silence_s() > SILENCE_S:
            # The start command would wait in a buffer and start the car later.
            raise LinkLostError(f"{car.port}: the car is silent for {SILENCE_S:g} s")
        delay_s = countdown_s if untethered else 0
        car.start_trial(
            settings["speed_m_s"],
            settings["yaw_rate_rad_s"],
            settings["time_limit_s"],
            trial,
            untethered,
            delay_s,
            button,
        )
        started = True
        if untethered:
            view.begin()
        # Nobody knows when the person presses the car's button.
        longest_s = math.inf if button else MAX_DELAY * (delay_s + settings["time_limit_s"]) + STORING_S
        return _watch(
            car,
            trial,
            view,
            end_s=time.monotonic() + longest_s,
            must_be_unplugged=untethered and _has_cable(car),
        )
    except LinkLostError as error:
        if untethered and started:
            return DriveEnd(DRIVES_ON, None, None)
        return DriveEnd("link lost", "aborted", elapsed_s(), error)
    except LogError as error:
        car.connection.log = None
        return DriveEnd("log could not be written", "aborted", elapsed_s(), error)
    except CommandRefusedError as error:
        fault = car.fault_text()
        if fault is not None:
            # The car had a fault in the countdown, for example because its board restarted.
            return DriveEnd(fault, "aborted", None, CarFaultError(f"the car did not start: {fault_line(car)}"))
        message = f"{error}{pace_hint(car, str(error))}"
        return DriveEnd("refused by the car", "aborted", None, CommandRefusedError(message))
    except KeyboardInterrupt:
        with contextlib.suppress(FoldcarError, KeyboardInterrupt):
            # If the program stood still before, the car has driven on after its last message that was read.
            if started:
                _stopped_s(car, trial)
        return DriveEnd(CTRL_C, "aborted", elapsed_s(), FoldcarError("stopped by Ctrl-C"))


def _count_down(car: ConnectedCar, countdown_s: int, view: DriveView) -> str | None:
    """Wait for the end of the countdown. Return how it was ended early, or None if it ran out."""
    view.begin()
    now_s = time.monotonic()
    end_s = now_s + countdown_s
    while now_s < end_s:
        last_turn_s = now_s
        car.connection.receive(min(STEP_S, end_s - now_s), view.other_input)
        ending = view.wants_stop()
        if ending is not None:
            return ending
        now_s = time.monotonic()
        if now_s - last_turn_s > SILENCE_S:
            # This program stood still, for example after Ctrl-Z. The car must not start as soon as it goes on, because
            # nobody expects it.
            return STOOD_STILL
    return None


def _has_cable(car: ConnectedCar) -> bool:
    """Return whether the car is a board, whose cable would disturb an untethered drive. A simulated car has none."""
    design = car.connection.latest.get("FOLDCAR_DESIGN")
    return design is not None and design.hardware == car.dialect.FOLDCAR_HARDWARE_BOARD


def _watch(car: ConnectedCar, trial: int, view: DriveView, end_s: float, must_be_unplugged: bool = False) -> DriveEnd:
    """Wait for the end of a drive and return how it ended.

    ``end_s`` is the latest possible end, by time.monotonic(). If ``must_be_unplugged`` is True, a car whose wheels start
    while its cable is still plugged in is stopped. Raises LinkLostError if the car is silent, or has not ended at
    ``end_s``.
    """
    last_boot_ms = 0
    last_turn_s = time.monotonic()
    while True:
        for message in car.connection.receive(STEP_S, view.other_input):
            if message.get_type() == "FOLDCAR_TRIAL":
                # If the time since the car's boot becomes smaller, the car has restarted.
                if message.time_boot_ms < last_boot_ms:
                    return car_restarted(car)
                last_boot_ms = message.time_boot_ms
            end = _end_in_message(car, message, trial, view, must_be_unplugged)
            if end is not None:
                return end
        ending = view.wants_stop()
        if ending is not None:
            return DriveEnd(ending, None, _stopped_s(car, trial))
        if car.connection.silence_s() > SILENCE_S:
            raise LinkLostError(f"{car.port}: the car is silent for {SILENCE_S:g} s")
        now_s = time.monotonic()
        turn_time_s = now_s - last_turn_s
        last_turn_s = now_s
        if turn_time_s > SILENCE_S:
            # This program stood still, for example because a person has stopped it. This time does not count.
            end_s += turn_time_s
        if now_s > end_s:
            raise LinkLostError(f"{car.port}: the car does not end trial {trial} at its time limit")


def _end_in_message(
    car: ConnectedCar, message: Any, trial: int, view: DriveView, must_be_unplugged: bool
) -> DriveEnd | None:
    """Return how the drive ended according to a message of the car, or None if the drive goes on.

    If the cable must be unplugged and the car drives nevertheless, the car is stopped.
    """
    if _has_ended(car, message, trial):
        return car_ended(car, message, view)
    if is_of_trial(message, trial):
        is_driving = message.state == car.dialect.FOLDCAR_STATE_RUNNING
        if is_driving and must_be_unplugged:
            car.stop_trial()
            return DriveEnd(STILL_PLUGGED_IN, "aborted", message.elapsed_ms / 1000)
        return None
    # The simulator of a simulated car sends its true state, with an outcome at the end.
    if message.get_type() == "FOLDCAR_TRUTH" and message.trial_id == trial and message.outcome:
        return simulated_outcome(car, message)
    return None


def _stopped_s(car: ConnectedCar, trial: int) -> float | None:
    """Stop the trial if the car has not ended it by itself; return its final time (s), None if the car reports none."""
    with contextlib.suppress(CommandRefusedError):
        car.stop_trial()
    car.connection.wait_for(lambda message: _has_ended(car, message, trial), 1.0)
    return _elapsed_s(car, trial)


def _elapsed_s(car: ConnectedCar, trial: int) -> float | None:
    """Return the time (s) of ``trial`` that the car reported last; None if its last report is of another trial."""
    message = car.connection.latest.get("FOLDCAR_TRIAL")
    if message is None or message.trial_id != trial:
        return None
    return float(message.elapsed_ms / 1000)


def _stand_still(car: ConnectedCar) -> None:
    """Stop and disarm the car if possible; a car with a fault refuses, but is already at rest."""

    def receive_last_messages() -> None:
        """Receive the messages that the car sends after its last command, so that the log has them, too."""
        car.connection.wait_for(lambda message: False, AFTERWARDS_S)

    for action in (car.stop_trial, car.disarm, receive_last_messages):
        with contextlib.suppress(FoldcarError, KeyboardInterrupt):
            action()


def _has_ended(car: ConnectedCar, message: Any, trial: int) -> bool:
    """Return whether a message says that the trial with this number has ended."""
    return is_of_trial(message, trial) and not car.is_under_way(message)
