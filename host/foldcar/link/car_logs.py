"""Fetches and erases the logs that a car keeps of untethered trials, over the link (format in docs/link.md).

Input: a car. Output: the logs' bytes as the car wrote them: records of time since boot (µs) and packet.
"""

import time
from collections.abc import Sequence
from dataclasses import dataclass

from foldcar.errors import FoldcarError
from foldcar.link.car import ANSWER_S, TRIES, ConnectedCar
from foldcar.link.connection import CAR_COMPONENT, CAR_SYSTEM

# Bytes per request, 64 packets of 90; lost parts are requested again.
WINDOW_BYTES = 90 * 64
# The range of numbers of all logs.
FIRST_LOG, LAST_LOG = 0, 0xFFFF
# Time limits for the list and for a log, and the silence after which a request is repeated.
LIST_S = 20.0
FETCH_S = 120.0
QUIET_S = 0.5


@dataclass(frozen=True, slots=True)
class StoredLog:
    """The number and the size of a log in the car's flash memory."""

    id: int
    size_bytes: int


def list_logs(car: ConnectedCar) -> list[StoredLog]:
    """Return the logs in the car, oldest first. Raises FoldcarError if the list is incomplete after 20 s."""
    car.connection.status_text = None
    end_s = time.monotonic() + LIST_S
    for _ in range(TRIES):
        logs = _try_to_list_logs(car, end_s)
        if logs is not None:
            return logs
    raise FoldcarError(f"{car.port}: the car does not list its logs{_status_suffix(car)}")


def _try_to_list_logs(car: ConnectedCar, end_s: float) -> list[StoredLog] | None:
    """Request the list of the car's logs once. Return None if a part of it is lost, or has not arrived at ``end_s``."""
    request = car.dialect.MAVLink_log_request_list_message(CAR_SYSTEM, CAR_COMPONENT, FIRST_LOG, LAST_LOG)
    car.connection.send(request)
    logs: dict[int, StoredLog] = {}
    while time.monotonic() < end_s:
        entry = car.connection.wait_for(lambda m: m.get_type() == "LOG_ENTRY", ANSWER_S)
        if entry is None:
            return None
        # A car without logs answers with a single entry, which describes no log.
        if entry.num_logs > 0:
            logs[entry.id] = StoredLog(entry.id, entry.size)
        if len(logs) == entry.num_logs:
            # The car sends the oldest log first. Do not sort by number: the log after number 65535 has the number 1.
            return list(logs.values())
    return None


def fetch_log(car: ConnectedCar, log: StoredLog) -> bytes:
    """Fetch a log from the car and return its bytes. Raises FoldcarError if they are incomplete after FETCH_S.

    The log is requested in windows of WINDOW_BYTES. If a packet is lost, the next request begins at the first missing
    byte.
    """
    content = bytearray()
    # Parts that have arrived before a part in front of them, by their offsets in the log.
    early_parts: dict[int, bytes] = {}
    car.connection.status_text = None
    end_s = time.monotonic() + FETCH_S
    while len(content) < log.size_bytes:
        start = len(content)
        if time.monotonic() > end_s:
            gap = f"byte {start} is missing{_status_suffix(car)}"
            raise FoldcarError(f"{car.port}: log {log.id} is incomplete after {FETCH_S:g} s: {gap}")
        count = min(WINDOW_BYTES, log.size_bytes - start)
        request = car.dialect.MAVLink_log_request_data_message(CAR_SYSTEM, CAR_COMPONENT, log.id, start, count)
        car.connection.send(request)
        window_end = start + count
        while len(content) < window_end and time.monotonic() < end_s:
            part = car.connection.wait_for(lambda m: m.get_type() == "LOG_DATA" and m.id == log.id, QUIET_S)
            if part is None:
                # The car sends no more parts of this window.
                break
            if start <= part.ofs < window_end:
                early_parts[part.ofs] = bytes(part.data[: part.count])
            next_part = early_parts.pop(len(content), b"")
            while next_part:
                content += next_part
                next_part = early_parts.pop(len(content), b"")
    return bytes(content[: log.size_bytes])


def erase_logs(car: ConnectedCar, logs: Sequence[StoredLog]) -> None:
    """Erase all logs in the car. ``logs`` are the logs that the caller expects there.

    If the car has other logs than these, for example because a trial was driven since, nothing is erased. Raises
    FoldcarError in this case, and if the car does not erase its logs.
    """
    if list_logs(car) != list(logs):
        raise FoldcarError(f"{car.port}: the car's logs have changed since they were compared: nothing is erased")
    for _ in range(TRIES):
        car.connection.send(car.dialect.MAVLink_log_erase_message(CAR_SYSTEM, CAR_COMPONENT))
        if not list_logs(car):
            return
    raise FoldcarError(f"{car.port}: the car has not erased its logs{_status_suffix(car)}")


def _status_suffix(car: ConnectedCar) -> str:
    """Return the car's status text for an error, because MAVLink's log protocol has no message for a refusal."""
    return f"; it says: {car.connection.status_text}" if car.connection.status_text else ""
