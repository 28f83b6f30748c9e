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

# After a trial the car stores what it has kept in RAM: 256 KiB at most, whose 64 sectors take some 0.1 s each.
STORING_S = 30.0


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
