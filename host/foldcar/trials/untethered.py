"""Completes an untethered trial with the log that the car kept while it drove without a cable.

Input: the car, connected again, and the host's log up to the loss of the link. Output: one log of both in order of
time, and how the drive ended.
"""

from pathlib import Path
from typing import Any

from foldcar.errors import FoldcarError
from foldcar.link.car import Car
from foldcar.link.car_logs import fetch_log, list_logs
from foldcar.link.tlog import merge_records, messages_of, records_of
from foldcar.trials.driving import DriveEnd


def collect(car: Car, trial: int, log: Path) -> DriveEnd:
    """Merge the car's log of ``trial`` into ``log``; FoldcarError if the car has none.

    The car's times count from its boot; the offset to the host's clock is that of the first packet of the trial that
    the host received.
    """
    offset_us = _clock_offset_us(log, trial)
    for stored in reversed(list_logs(car)):
        records = records_of(fetch_log(car, stored), f"log {stored.id} of the car")
        messages = [m for _, m in messages_of(records) if m.get_type() == "FOLDCAR_TRIAL" and m.trial_id == trial]
        if not messages:
            continue
        merge_records(log, [(time_us + offset_us, packet) for time_us, packet in records])
        return _end(car, messages[-1])
    raise FoldcarError(f"{car.port}: the car has no log of trial {trial}")


def _clock_offset_us(log: Path, trial: int) -> int:
    for time_us, message in messages_of(records_of(log.read_bytes(), str(log))):
        if message.get_type() == "FOLDCAR_TRIAL" and message.trial_id == trial:
            return int(time_us - 1000 * message.time_boot_ms)
    raise FoldcarError(f"{log}: contains no message of trial {trial} from before the cable was unplugged")


def _end(car: Car, last: Any) -> DriveEnd:
    dialect, elapsed_s = car.dialect, last.elapsed_ms / 1000
    if last.end == dialect.FOLDCAR_END_TIME_LIMIT:
        return DriveEnd("time limit, untethered", "timeout", elapsed_s)
    if last.end == dialect.FOLDCAR_END_FAULT:
        return DriveEnd("fault, untethered", "aborted", elapsed_s)
    return DriveEnd("stopped, untethered", None, elapsed_s)
