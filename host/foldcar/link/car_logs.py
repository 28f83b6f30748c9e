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
        # Logs 0 to 0xFFFF are all logs.
        car.connection.send(car.dialect.MAVLink_log_request_list_message(CAR_SYSTEM, CAR_COMPONENT, 0, 0xFFFF))
        logs: dict[int, StoredLog] = {}
        # How many logs the car has; None before its first answer.
        log_count: int | None = None
        while (log_count is None or len(logs) < log_count) and time.monotonic() < end_s:
            entry = car.connection.wait_for(lambda m: m.get_type() == "LOG_ENTRY", ANSWER_S)
            if entry is None:
                break
            log_count = entry.num_logs
            # A car without logs answers with a single entry, which describes no log.
            if entry.num_logs:
                logs[entry.id] = StoredLog(entry.id, entry.size)
        if log_count is not None and len(logs) == log_count:
            # The car sends the oldest log first. Do not sort by number: the log after number 65535 has the number 1.
            return list(logs.values())
    raise FoldcarError(f"{car.port}: the car does not list its logs{_status_suffix(car)}")


def fetch_log(car: ConnectedCar, log: StoredLog) -> bytes:
    """Fetch a log from the car and return its bytes. Raises FoldcarError if they are incomplete after FETCH_S.

    The log is requested in windows of WINDOW_BYTES. If a packet is lost, the next request begins at the first missing
    byte.
    """
    content = bytearray()
    # Parts that arrived, by their offsets, until they can be appended to the content.
    parts: dict[int, bytes] = {}
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
        while len(content) < start + count and time.monotonic() < end_s:
            part = car.connection.wait_for(lambda m: m.get_type() == "LOG_DATA" and m.id == log.id, QUIET_S)
            if part is None:
                break
            if start <= part.ofs < start + count:
                parts[part.ofs] = bytes(part.data[: part.count])
            while parts.get(len(content)):
                content += parts.pop(len(content))
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
