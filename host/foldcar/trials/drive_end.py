"""Describes how a drive ended, from the messages of the car or of its simulator.

Input: a connected car and its messages. Output: the ending in words, and the trial's outcome if it is known.
"""

from dataclasses import dataclass
from typing import Any

from foldcar.errors import FoldcarError
from foldcar.link.car import ConnectedCar
from foldcar.trials.drive_view import DriveView
from foldcar.trials.faults import CarFaultError, crash_line, fault_line

# A simulated car sends its true state every 0.02 s.
TRUTH_S = 0.5
# A simulated car whose clock has at least this rate runs faster than real time.
MIN_FAST_RATE = 1.5


@dataclass(frozen=True, slots=True)
class DriveEnd:
    """The end of a drive.

    ``ending`` says in words how it ended. ``outcome`` is one of TRIAL_OUTCOMES, or None if a person must judge it.
    ``elapsed_time_s`` is the time that the car has driven, None if it is unknown. ``error`` is the error that aborted the
    drive, if there was one. ``later_faults`` describe faults that the car had after the end and that are acknowledged.
    """

    ending: str
    outcome: str | None
    elapsed_time_s: float | None
    error: FoldcarError | None = None
    later_faults: tuple[str, ...] = ()


def is_of_trial(message: Any, trial: int) -> bool:
    """Return whether a message is a FOLDCAR_TRIAL, the state of a trial, of the trial with this number."""
    return bool(message.get_type() == "FOLDCAR_TRIAL" and message.trial_id == trial)


def car_restarted(car: ConnectedCar) -> DriveEnd:
    """Return the end of a drive in which the car restarted, with the fault that it reports and where it crashed."""
    fault, crash = fault_line(car), crash_line(car)
    message = "the car restarted" if fault is None else f"the car restarted: {fault}"
    ending = "the car restarted" if crash is None else f"the car restarted: {crash}"
    return DriveEnd(ending, outcome="aborted", elapsed_time_s=None, error=CarFaultError(message))


def car_ended(car: ConnectedCar, message: Any, view: DriveView) -> DriveEnd:
    """Return how a drive ended that the car itself has ended. ``message`` is the car's FOLDCAR_TRIAL that says so.

    If this program is suspended for a while, the car stops with a fault, because it hears nothing. Meanwhile, messages
    and pressed keys wait. Among them may be the outcome of a simulated car's drive, or the key with which a person
    ended the drive. Both came before the fault, so they decide how the drive ended.
    """
    elapsed_s = message.elapsed_ms / 1000
    if message.end == car.dialect.FOLDCAR_END_TIME_LIMIT:
        return DriveEnd("time limit", "timeout", elapsed_s)
    if message.end != car.dialect.FOLDCAR_END_FAULT:
        return DriveEnd("stopped by another host", None, elapsed_s)
    true_state = _next_truth(car, message.trial_id)
    if true_state is not None and true_state.outcome:
        return simulated_outcome(car, true_state)
    ending = view.wants_stop()
    if ending is not None:
        return DriveEnd(ending, None, elapsed_s)
    fault = car.fault_text() or "fault"
    line = fault_line(car) or fault
    error = CarFaultError(f"the car stopped: {line}{pace_hint(car, fault)}")
    return DriveEnd(fault, outcome="aborted", elapsed_time_s=elapsed_s, error=error)


def _next_truth(car: ConnectedCar, trial: int) -> Any | None:
    """Wait for the next message FOLDCAR_TRUTH of a trial, and return it. It has the true state of a simulated car.

    Return None if a built car drives, which sends no such messages.
    """
    if "FOLDCAR_TRUTH" not in car.connection.latest:
        return None

    def is_truth_of_trial(message: Any) -> bool:
        """Return whether a message is a FOLDCAR_TRUTH of the trial."""
        return bool(message.get_type() == "FOLDCAR_TRUTH" and message.trial_id == trial)

    return car.connection.wait_for(is_truth_of_trial, TRUTH_S)


def pace_hint(car: ConnectedCar, message: str) -> str:
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


def simulated_outcome(car: ConnectedCar, message: Any) -> DriveEnd:
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
