"""Drives a car through one trial: arm, start, watch, stop. The car is stopped after every error.

Input: a connected car and the settings of a run (docs/carsim.md). Output: how the drive ended, and its outcome where
that follows. The log that a car kept while it drove without a cable completes that of the host. Nothing asks or prints.
"""

import contextlib
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

from foldcar.errors import FoldcarError
from foldcar.link.car import Car, CommandRefusedError
from foldcar.link.car_logs import fetch_log, list_logs
from foldcar.link.stream import LinkLostError
from foldcar.link.tlog import LogError, merge_records, messages_of, records_of

# The car stops 0.5 s after the last heartbeat; silence of this length is not a brief disturbance.
SILENCE_S = 2.0
AFTERWARDS_S = 0.3
# The ending of an untethered drive whose cable is unplugged.
DRIVES_ON = "drives on untethered"
CTRL_C = "Ctrl-C"
# After a trial the car stores what it has kept in RAM: 256 KiB at most, whose 64 sectors take some 0.1 s each.
STORING_S = 30.0
STEP_S = 0.05


@dataclass(frozen=True, slots=True)
class DriveEnd:
    """The end of a drive: a text, the outcome or None if a person must judge, and the error that aborted it, if any."""

    ending: str
    outcome: str | None
    elapsed_time_s: float | None
    error: FoldcarError | None = None


class Watcher(Protocol):
    """The observer of a drive: sees the car's messages, and may request a stop."""

    # A file whose input ends the wait for messages early, or None.
    other_input: Any

    def look(self, car: Car) -> None:
        """Display the car's state; called several times a second."""

    def wants_stop(self) -> str | None:
        """The reason for which the drive is to stop, or None."""


def drive(
    car: Car, settings: Mapping[str, Any], trial: int, countdown_s: int, watcher: Watcher, untethered: bool = False
) -> DriveEnd:
    """Drive one trial. Errors of car, cable and disk and Ctrl-C are not raised, but returned in the result.

    ``settings`` has ``speed_m_s``, ``yaw_rate_rad_s`` and ``time_limit_s``. When the cable of an ``untethered`` drive
    is unplugged, the drive ends as DRIVES_ON and the car is not stopped.
    """
    # Before the start, the car still tells of its last trial, which in another store may have had the same number.
    started = left_alone = False
    try:
        with contextlib.suppress(CommandRefusedError):
            # Ends an earlier drive; a car in a state that forbids driving refuses to arm, with the reason.
            car.stop_trial()
        car.arm()
        stop = _count_down(car, countdown_s, watcher)
        if stop is not None:
            return DriveEnd(f"{stop} before the start", "aborted", None)
        if car.connection.silence_s() > SILENCE_S:
            # A start would wait in a buffer until the car reads again.
            raise LinkLostError(f"{car.port}: the car is silent for {SILENCE_S:g} s")
        car.start_trial(
            settings["speed_m_s"], settings["yaw_rate_rad_s"], settings["time_limit_s"], trial, untethered
        )
        started = True
        return _watch(car, trial, watcher)
    except LinkLostError as error:
        left_alone = untethered and started
        if left_alone:
            return DriveEnd(DRIVES_ON, None, None)
        return DriveEnd("link lost", "aborted", _elapsed_s(car, trial) if started else None, error)
    except LogError as error:
        car.connection.log = None
        return DriveEnd("log could not be written", "aborted", _elapsed_s(car, trial) if started else None, error)
    except CommandRefusedError as error:
        why = "; see what is wrong, then acknowledge it" if car.fault_text() else ""
        return DriveEnd("refused by the car", "aborted", None, FoldcarError(f"{error}{why}"))
    except KeyboardInterrupt:
        elapsed_s = _elapsed_s(car, trial) if started else None
        return DriveEnd(CTRL_C, "aborted", elapsed_s, FoldcarError("stopped by Ctrl-C"))
    finally:
        if not left_alone:
            _stand_still(car)


def _count_down(car: Car, countdown_s: int, watcher: Watcher) -> str | None:
    end_s = time.monotonic() + countdown_s
    while (left_s := end_s - time.monotonic()) > 0:
        car.connection.receive(min(STEP_S, left_s), watcher.other_input)
        watcher.look(car)
        stop = watcher.wants_stop()
        if stop is not None:
            return stop
    return None


def _watch(car: Car, trial: int, watcher: Watcher) -> DriveEnd:
    dialect, connection = car.dialect, car.connection
    booted_ms = 0
    while True:
        for message in connection.receive(STEP_S, watcher.other_input):
            kind = message.get_type()
            if kind == "FOLDCAR_TRIAL":
                if message.time_boot_ms < booted_ms:
                    return DriveEnd("the car restarted", "aborted", None)
                booted_ms = message.time_boot_ms
                if message.trial_id == trial and message.state != dialect.FOLDCAR_STATE_RUNNING:
                    return _car_ended(car, message)
            elif kind == "FOLDCAR_TRUTH" and message.trial_id == trial and message.outcome:
                return _simulated_outcome(car, message)
        watcher.look(car)
        stop = watcher.wants_stop()
        if stop is not None:
            car.stop_trial()
            _await_end(car, trial)
            return DriveEnd(stop, None, _elapsed_s(car, trial))
        if connection.silence_s() > SILENCE_S:
            raise LinkLostError(f"{car.port}: the car is silent for {SILENCE_S:g} s")


def _car_ended(car: Car, message: Any) -> DriveEnd:
    elapsed_s = message.elapsed_ms / 1000
    if message.end == car.dialect.FOLDCAR_END_TIME_LIMIT:
        return DriveEnd("time limit", "timeout", elapsed_s)
    if message.end == car.dialect.FOLDCAR_END_FAULT:
        fault = car.fault_text() or "fault"
        return DriveEnd(fault, "aborted", elapsed_s, FoldcarError(f"the car stopped: {fault}"))
    return DriveEnd("stopped by another host", None, elapsed_s)


def _simulated_outcome(car: Car, message: Any) -> DriveEnd:
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


def _await_end(car: Car, trial: int) -> None:
    """Wait for the message with the trial's final elapsed time."""

    def ended(message: Any) -> bool:
        if message.get_type() != "FOLDCAR_TRIAL" or message.trial_id != trial:
            return False
        return bool(message.state != car.dialect.FOLDCAR_STATE_RUNNING)

    car.connection.wait_for(ended, 1.0)


def _elapsed_s(car: Car, trial: int) -> float | None:
    last = car.connection.latest.get("FOLDCAR_TRIAL")
    return last.elapsed_ms / 1000 if last is not None and last.trial_id == trial else None


def _stand_still(car: Car) -> None:
    """Stop and disarm if possible; a car in a fault refuses, and is at rest already."""
    with contextlib.suppress(FoldcarError, KeyboardInterrupt):
        car.stop_trial()
    with contextlib.suppress(FoldcarError, KeyboardInterrupt):
        car.disarm()
    with contextlib.suppress(FoldcarError, KeyboardInterrupt):
        car.connection.wait_for(lambda message: False, AFTERWARDS_S)


def collect(car: Car, trial: int, log: Path) -> DriveEnd:
    """Merge the car's log of ``trial`` into ``log``; FoldcarError if the car has none, or has not stored it in 30 s.

    The car's times count from its boot; the offset to the host's clock is that of the first packet of the trial that
    the host received.
    """
    offset_us = _clock_offset_us(log, trial)
    told = car.connection.wait_for(lambda m: m.get_type() == "FOLDCAR_TRIAL" and _is_stored(car, m), STORING_S)
    if told is None:
        raise FoldcarError(f"{car.port}: the car still stores its log after {STORING_S:g} s")
    lost_bytes = told.log_lost if told.trial_id == trial else 0
    for stored in reversed(list_logs(car)):
        records = records_of(fetch_log(car, stored), f"log {stored.id} of the car")
        messages = [m for _, m in messages_of(records) if m.get_type() == "FOLDCAR_TRIAL" and m.trial_id == trial]
        if not messages:
            continue
        merge_records(log, [(time_us + offset_us, packet) for time_us, packet in records])
        return drive_end(car.dialect, messages[-1], lost_bytes)
    raise FoldcarError(
        f"{car.port}: the car has no log of trial {trial}: it restarted while it drove, or its flash is full"
    )


def _is_stored(car: Car, message: Any) -> bool:
    return bool(message.log != car.dialect.FOLDCAR_LOG_OPEN)


def _clock_offset_us(log: Path, trial: int) -> int:
    for time_us, message in messages_of(records_of(log.read_bytes(), str(log))):
        if message.get_type() == "FOLDCAR_TRIAL" and message.trial_id == trial:
            return int(time_us - 1000 * message.time_boot_ms)
    raise FoldcarError(f"{log}: contains no message of trial {trial} from before the cable was unplugged")


def drive_end(dialect: Any, last: Any, lost_bytes: int) -> DriveEnd:
    """How a drive ended, by its log's last FOLDCAR_TRIAL; ``lost_bytes``: what the car has said later to be missing."""
    elapsed_s = last.elapsed_ms / 1000
    lost_bytes = max(lost_bytes, last.log_lost)
    gap = f", {lost_bytes} bytes of its log lost" if lost_bytes else ""
    if last.end == dialect.FOLDCAR_END_TIME_LIMIT:
        return DriveEnd(f"time limit, untethered{gap}", "timeout", elapsed_s)
    if last.end == dialect.FOLDCAR_END_FAULT:
        return DriveEnd(f"fault, untethered{gap}", "aborted", elapsed_s)
    if last.end == dialect.FOLDCAR_END_NONE:
        return DriveEnd(f"its log breaks off, untethered{gap}", "aborted", elapsed_s)
    return DriveEnd(f"stopped, untethered{gap}", None, elapsed_s)
