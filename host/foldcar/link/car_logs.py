"""Logs that a car keeps of untethered trials, fetched over the link; docs/link.md has their form.

Input: a car. Output: records of time since boot in µs and packet, as the car wrote them.
"""

import time
from dataclasses import dataclass

from foldcar.errors import FoldcarError
from foldcar.link.car import ANSWER_S, TRIES, Car
from foldcar.link.connection import CAR_COMPONENT, CAR_SYSTEM

# Asked for at once; what of it gets lost is asked for again.
WINDOW_BYTES = 90 * 64
FETCH_S = 120.0
QUIET_S = 0.5


@dataclass(frozen=True, slots=True)
class StoredLog:
    """A log in the car's flash."""

    id: int
    size_bytes: int


def list_logs(car: Car) -> list[StoredLog]:
    """The logs in the car, oldest first; FoldcarError if it does not answer."""
    for _ in range(TRIES):
        car.connection.send(car.dialect.MAVLink_log_request_list_message(CAR_SYSTEM, CAR_COMPONENT, 0, 0xFFFF))
        found: dict[int, StoredLog] = {}
        expected: int | None = None
        while expected is None or len(found) < expected:
            entry = car.connection.wait_for(lambda m: m.get_type() == "LOG_ENTRY", ANSWER_S)
            if entry is None:
                break
            expected = entry.num_logs
            if entry.num_logs:
                found[entry.id] = StoredLog(entry.id, entry.size)
        if expected is not None and len(found) == expected:
            return [found[number] for number in sorted(found)]
    raise FoldcarError(f"{car.port}: the car does not list its logs")


def fetch_log(car: Car, log: StoredLog) -> bytes:
    """The bytes of a log; FoldcarError if they do not come whole."""
    parts: dict[int, bytes] = {}
    end_s = time.monotonic() + FETCH_S
    while (start := _missing(parts, log.size_bytes)) is not None:
        if time.monotonic() > end_s:
            raise FoldcarError(f"{car.port}: log {log.id} did not come whole: it lacks what begins at byte {start}")
        count = min(WINDOW_BYTES, log.size_bytes - start)
        request = car.dialect.MAVLink_log_request_data_message(CAR_SYSTEM, CAR_COMPONENT, log.id, start, count)
        car.connection.send(request)
        while _missing(parts, start + count) is not None:
            part = car.connection.wait_for(lambda m: m.get_type() == "LOG_DATA" and m.id == log.id, QUIET_S)
            if part is None:
                break
            parts[part.ofs] = bytes(part.data[: part.count])
    return b"".join(parts[start] for start in sorted(parts))[: log.size_bytes]


def _missing(parts: dict[int, bytes], end: int) -> int | None:
    """Where the first gap before ``end`` begins; None if there is none."""
    at = 0
    while at < end:
        if not parts.get(at):
            return at
        at += len(parts[at])
    return None
