"""Fetches the log that a car keeps while it drives without its cable, and merges it into the host's log of the trial.

Input: a car that is plugged in again, the host's log. Output: the merged log, and how the drive ended.
"""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

from foldcar.errors import FoldcarError
from foldcar.link.car import ConnectedCar
from foldcar.link.car_logs import fetch_log, list_logs
from foldcar.link.tlog import merge_records, messages_of, read_tlog, records_of
from foldcar.trials.drive_end import DriveEnd, drive_end, is_of_trial
from foldcar.trials.faults import crash_line

# How long to wait for the car's next message about its trial, which it sends several times a second.
MESSAGE_S = 2.0
# After a trial the car writes its log from RAM to flash: at most 256 KiB, whose 64 sectors take about 0.1 s each.
STORING_S = 30.0
WAITING = "waiting until the car's flash is ready for the next log"


def merge_cars_log(car: ConnectedCar, trial: int, log: Path, tell: Callable[[str], None]) -> DriveEnd:
    """Fetch the car's own log of a trial, merge it into the host's file ``log``, and return how the drive ended.

    ``tell`` is called with a line to print if this has to wait for the car's flash. Raises FoldcarError if the car is
    still storing its log after STORING_S, if it has no log of the trial, or if ``log`` has no message of the trial.
    """
    # The times in the car's log count from its boot, those in the host's log are the host's.
    offset_us = _clock_offset_us(log, trial)
    status = wait_for_storage(car, tell)
    if status is None:
        raise FoldcarError(f"{car.port}: the car is still storing its log after {STORING_S:g} s")
    lost_bytes = status.log_lost if status.trial_id == trial else 0
    # The list begins with the oldest log, and the trial is probably in the latest one.
    for stored_log in reversed(list_logs(car)):
        records, damaged_bytes = records_of(fetch_log(car, stored_log))
        messages_of_trial = [message for _, message in messages_of(records) if is_of_trial(message, trial)]
        if messages_of_trial:
            merge_records(log, [(time_us + offset_us, packet) for time_us, packet in records])
            end = drive_end(car.dialect, messages_of_trial[-1], lost_bytes + damaged_bytes)
            return _with_crash(car, messages_of_trial[-1], end)
    raise FoldcarError(
        f"{car.port}: the car has no log of trial {trial}: it restarted while it drove, or its flash is full"
    )


def _with_crash(car: ConnectedCar, last_message: Any, end: DriveEnd) -> DriveEnd:
    """Return how a drive ended, with the place in the firmware where it crashed if it crashed during the drive.

    ``end`` is the end without this place. It is returned unchanged if the firmware did not crash, or if the car has not
    stored the place. ``last_message`` is the last message about the trial in the car's log, a FOLDCAR_TRIAL.
    """
    log_has_end = last_message.end != car.dialect.FOLDCAR_END_NONE
    if log_has_end:
        return end
    # The firmware may have crashed. It remembers where as long as the board keeps its power.
    crash = crash_line(car)
    if crash is None:
        return end
    return replace(end, ending=f"{end.ending}: {crash}")


def _clock_offset_us(log: Path, trial: int) -> int:
    """Return what must be added to the car's time since its boot (µs) to get the host's clock.

    It follows from the first message of ``trial`` in the host's ``log``. Raises FoldcarError if there is none.
    """
    for received_us, message in read_tlog(log):
        if is_of_trial(message, trial):
            return int(received_us - 1000 * message.time_boot_ms)
    raise FoldcarError(f"{log}: contains no message of trial {trial} from before the cable was unplugged")


def wait_for_storage(car: ConnectedCar, tell: Callable[[str], None]) -> Any | None:
    """Wait until the car's flash is ready for a new log. Return the car's first FOLDCAR_TRIAL then.

    After a drive, the car stores its log and erases space for the next one; it also does so after its start. If this is
    not done yet, ``tell`` is called with WAITING. Returns None if the car sends no FOLDCAR_TRIAL, or is not ready after
    STORING_S.
    """
    is_open = car.dialect.FOLDCAR_LOG_OPEN

    def is_state(message: Any) -> bool:
        """Return whether a message is a FOLDCAR_TRIAL, which has the state of the car's log."""
        return bool(message.get_type() == "FOLDCAR_TRIAL")

    state = car.connection.wait_for(is_state, MESSAGE_S)
    if state is None or state.log != is_open:
        return state
    tell(WAITING)
    return car.connection.wait_for(lambda message: is_state(message) and message.log != is_open, STORING_S)
