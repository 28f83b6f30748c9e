"""Drives a car through one trial: arm, start, watch, stop. The car is stopped after every error.

Input: a connected car and the settings of a run (docs/carsim.md). Output: how the drive ended, and its outcome if it is
known. The log that an untethered car keeps is merged into the host's log. This module neither asks nor prints.
"""

import contextlib
import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from foldcar.errors import FoldcarError
from foldcar.link.car import CommandRefusedError, ConnectedCar
from foldcar.link.car_logs import fetch_log, list_logs
from foldcar.link.stream import LinkLostError
from foldcar.link.tlog import LogError, merge_records, messages_of, read_tlog, records_of
from foldcar.trials.drive_view import DriveView
from foldcar.trials.faults import CarFaultError, crash_line, fault_line

# A car that is silent for so long is lost. If this program stands still for so long, it was stopped (Ctrl-Z).
SILENCE_S = 2.0
AFTERWARDS_S = 0.3
# Ending of an untethered drive: the cable is unplugged and the car drives on.
DRIVES_ON = "drives on untethered"
STILL_PLUGGED_IN = "the cable was still plugged in when the wheels started"
CTRL_C = "Ctrl-C"
STOOD_STILL = "this program stood still"
# After a trial the car writes its log from RAM to flash: at most 256 KiB, whose 64 sectors take about 0.1 s each.
STORING_S = 30.0
WAITING = "waiting until the car's flash is ready for the next log"
STEP_S = 0.05
# A simulated car sends its true state every 0.02 s.
TRUTH_S = 0.5
# A simulated car's clock may run slower than the host's by at most this factor.
MAX_DELAY = 20.0
# A simulated car whose clock has at least this rate runs faster than real time.
MIN_FAST_RATE = 1.5


@dataclass(frozen=True, slots=True)
class DriveEnd:
    """The end of a drive: ``ending`` says in words how it ended, ``error`` is the error that aborted it, if any.

    ``outcome`` is one of TRIAL_OUTCOMES, None if a person must judge it.
    """

    ending: str
    outcome: str | None
    elapsed_time_s: float | None
    error: FoldcarError | None = None


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
        message = f"{error}{_pace_hint(car, str(error))}"
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
    dialect, connection = car.dialect, car.connection
    # The car's time in its last message, and the host's time of the last turn of the loop.
    last_boot_ms, turn_s = 0, time.monotonic()

    while True:
        for message in connection.receive(STEP_S, view.other_input):
            message_type = message.get_type()
            if message_type == "FOLDCAR_TRIAL":
                # If the time since the car's boot becomes smaller, the car has restarted.
                if message.time_boot_ms < last_boot_ms:
                    return _car_restarted(car)
                last_boot_ms = message.time_boot_ms
                if _has_ended(car, message, trial):
                    return _car_ended(car, message, view)
                if must_be_unplugged and _is_of(message, trial) and message.state == dialect.FOLDCAR_STATE_RUNNING:
                    car.stop_trial()
                    return DriveEnd(STILL_PLUGGED_IN, "aborted", message.elapsed_ms / 1000)
            elif message_type == "FOLDCAR_TRUTH" and message.trial_id == trial and message.outcome:
                return _simulated_outcome(car, message)
        ending = view.wants_stop()
        if ending is not None:
            return DriveEnd(ending, None, _stopped_s(car, trial))
        if connection.silence_s() > SILENCE_S:
            raise LinkLostError(f"{car.port}: the car is silent for {SILENCE_S:g} s")
        now_s = time.monotonic()
        if now_s - turn_s > SILENCE_S:
            # This program stood still, for example because a person has stopped it. This time does not count.
            end_s += now_s - turn_s
        turn_s = now_s
        if now_s > end_s:
            raise LinkLostError(f"{car.port}: the car does not end trial {trial} at its time limit")


def _car_restarted(car: ConnectedCar) -> DriveEnd:
    """Return the end of a drive in which the car restarted, with the fault that it reports and where it crashed."""
    fault, crash = fault_line(car), crash_line(car)
    message = "the car restarted" if fault is None else f"the car restarted: {fault}"
    ending = "the car restarted" if crash is None else f"the car restarted: {crash}"
    return DriveEnd(ending, outcome="aborted", elapsed_time_s=None, error=CarFaultError(message))


def _car_ended(car: ConnectedCar, message: Any, view: DriveView) -> DriveEnd:
    """Return how a drive ended that the car itself has ended. ``message`` is the car's FOLDCAR_TRIAL that says so.

    The car stops with a fault if this program stands still. Then messages and keys wait until it goes on. The outcome of
    the simulator or a key may be among them, and came before the fault. So these are examined before the fault.
    """
    elapsed_s = message.elapsed_ms / 1000
    if message.end == car.dialect.FOLDCAR_END_TIME_LIMIT:
        return DriveEnd("time limit", "timeout", elapsed_s)
    if message.end != car.dialect.FOLDCAR_END_FAULT:
        return DriveEnd("stopped by another host", None, elapsed_s)
    truth = _next_truth(car, message.trial_id)
    if truth is not None and truth.outcome:
        return _simulated_outcome(car, truth)
    ending = view.wants_stop()
    if ending is not None:
        return DriveEnd(ending, None, elapsed_s)
    fault = car.fault_text() or "fault"
    line = fault_line(car) or fault
    error = CarFaultError(f"the car stopped: {line}{_pace_hint(car, fault)}")
    return DriveEnd(fault, outcome="aborted", elapsed_time_s=elapsed_s, error=error)


def _next_truth(car: ConnectedCar, trial: int) -> Any | None:
    """Wait for the next FOLDCAR_TRUTH of a trial, which has the true state of a simulated car.

    Return None if a built car drives, which sends no such messages.
    """
    if "FOLDCAR_TRUTH" not in car.connection.latest:
        return None

    def is_truth_of_trial(message: Any) -> bool:
        """Return whether a message is a FOLDCAR_TRUTH of the trial."""
        return bool(message.get_type() == "FOLDCAR_TRUTH" and message.trial_id == trial)

    return car.connection.wait_for(is_truth_of_trial, TRUTH_S)


def _pace_hint(car: ConnectedCar, message: str) -> str:
    """Return a hint on --speedup if ``message`` is about late heartbeats of a car that is simulated too fast.

    Returns "" for other messages, and for cars whose clock runs about as fast as the host's.
    """
    rate = car.connection.clock_rate.value
    if rate < MIN_FAST_RATE or not any(word in message for word in ("heartbeat", "CMD_TIMEOUT")):
        return ""
    return (
        f"; the simulated car's clock runs {rate:.1f} times as fast as this computer's, which leaves too little time "
        "between heartbeats: start `foldcar link` with a smaller --speedup"
    )


def _simulated_outcome(car: ConnectedCar, message: Any) -> DriveEnd:
    """Stop a simulated car at the outcome that its simulator reports, and return that."""
    car.stop_trial()
    dialect = car.dialect
    outcome = {
        dialect.FOLDCAR_OUTCOME_PASSED: "passed",
        dialect.FOLDCAR_OUTCOME_TIPPED: "tipped",
        dialect.FOLDCAR_OUTCOME_STUCK: "stuck",
        dialect.FOLDCAR_OUTCOME_OFF_COURSE: "off_course",
    }.get(message.outcome)
    ending = "goal" if outcome == "passed" else f"simulator saw {outcome}"
    return DriveEnd(ending, outcome, message.outcome_time)


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


def merge_cars_log(car: ConnectedCar, trial: int, log: Path, tell: Callable[[str], None]) -> DriveEnd:
    """Fetch the car's own log of a trial, merge it into the host's file ``log``, and return how the drive ended.

    The times in the car's log count from its boot. They are converted to the host's clock by the first packet of the
    trial in ``log``, which has both times. ``tell`` is called with a line to print if this has to wait for the car's
    flash.

    Raises FoldcarError if the car is still storing its log after STORING_S, if it has no log of the trial, or if ``log``
    has no message of the trial.
    """
    offset_us = _clock_offset_us(log, trial)
    status = wait_for_storage(car, tell)
    if status is None:
        raise FoldcarError(f"{car.port}: the car is still storing its log after {STORING_S:g} s")
    lost_bytes = status.log_lost if status.trial_id == trial else 0
    # The list begins with the oldest log, and the trial is probably in the latest one.
    for stored_log in reversed(list_logs(car)):
        records, damaged_bytes = records_of(fetch_log(car, stored_log))
        messages = [message for _, message in messages_of(records) if _is_of(message, trial)]
        if not messages:
            continue
        merge_records(log, [(time_us + offset_us, packet) for time_us, packet in records])
        last_message = messages[-1]
        end = drive_end(car.dialect, last_message, lost_bytes + damaged_bytes)
        if last_message.end == car.dialect.FOLDCAR_END_NONE:
            # The log does not contain the end of the drive, so the firmware may have crashed. If the battery of the
            # board has stayed on, the board still knows where it crashed.
            crash = crash_line(car)
            if crash is not None:
                return replace(end, ending=f"{end.ending}: {crash}")
        return end
    raise FoldcarError(
        f"{car.port}: the car has no log of trial {trial}: it restarted while it drove, or its flash is full"
    )


def _clock_offset_us(log: Path, trial: int) -> int:
    """Return what must be added to the car's time since its boot (µs) to get the host's clock.

    It follows from the first message of ``trial`` in the host's ``log``. Raises FoldcarError if there is none.
    """
    for received_us, message in read_tlog(log):
        if _is_of(message, trial):
            return int(received_us - 1000 * message.time_boot_ms)
    raise FoldcarError(f"{log}: contains no message of trial {trial} from before the cable was unplugged")


def wait_for_storage(car: ConnectedCar, tell: Callable[[str], None]) -> Any | None:
    """Wait until the car's flash is ready for a new log. Return the car's first FOLDCAR_TRIAL then.

    After a drive, the car stores its log and erases space for the next one; it also does so after its start. If this is
    not done yet, ``tell`` is called with WAITING. Returns None if the car sends no FOLDCAR_TRIAL, or is not ready after
    STORING_S.
    """
    is_open = car.dialect.FOLDCAR_LOG_OPEN
    status = car.connection.wait_for(lambda m: m.get_type() == "FOLDCAR_TRIAL", SILENCE_S)
    if status is None or status.log != is_open:
        return status
    tell(WAITING)
    return car.connection.wait_for(lambda m: m.get_type() == "FOLDCAR_TRIAL" and m.log != is_open, STORING_S)


def _is_of(message: Any, trial: int) -> bool:
    """Return whether a message is a FOLDCAR_TRIAL, the state of a trial, of the trial with this number."""
    return bool(message.get_type() == "FOLDCAR_TRIAL" and message.trial_id == trial)


def _has_ended(car: ConnectedCar, message: Any, trial: int) -> bool:
    """Return whether a message says that the trial with this number has ended."""
    return _is_of(message, trial) and not car.is_under_way(message)


def drive_end(dialect: Any, message: Any, lost_bytes: int) -> DriveEnd:
    """Return how an untethered drive ended, from ``message``, the last FOLDCAR_TRIAL in the car's log.

    A drive without a fault has no outcome, because without its cable the car cannot be told that it has passed: even one
    that has crossed the goal drives on to its time limit. A person must judge it.

    ``lost_bytes`` is how many bytes of the log are known to be missing or damaged.
    """
    elapsed_s = message.elapsed_ms / 1000
    lost_bytes = max(lost_bytes, message.log_lost)
    lost_text = f", {lost_bytes} bytes of its log lost" if lost_bytes else ""
    if message.end == dialect.FOLDCAR_END_TIME_LIMIT:
        return DriveEnd(f"time limit, untethered{lost_text}", None, elapsed_s)
    if message.end == dialect.FOLDCAR_END_FAULT:
        return DriveEnd(f"fault, untethered{lost_text}", "aborted", elapsed_s)
    if message.end == dialect.FOLDCAR_END_NONE:
        return DriveEnd(f"its log breaks off, untethered{lost_text}", "aborted", elapsed_s)
    return DriveEnd(f"stopped, untethered{lost_text}", None, elapsed_s)
