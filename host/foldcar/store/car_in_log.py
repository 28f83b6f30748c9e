"""Tells from a trial's log whether a built or a simulated car drove, for stores up to version 4, which do not say it.

Both send SERVO_OUTPUT_RAW 50 times a second, a simulated one as often FOLDCAR_TRUTH, a built one never.
"""

import struct
from collections import Counter
from pathlib import Path

from foldcar.link.tlog import LogError, records_of
from foldcar.store.errors import StoreError
from foldcar.store.log_files import log_file, sha256_of
from foldcar.store.trial_records import BUILT, SIMULATED

SERVO_OUTPUT_RAW, FOLDCAR_TRUTH = 36, 44003
CAR_SYSTEM = 1
# 0.2 s of a drive, in which a simulated car sends ten truths; less says nothing.
LEAST_PULSES = 10


def car_in_log(store: Path, log: str, sha256: str | None) -> str | None:
    """BUILT or SIMULATED; None if the log is gone, is not what was written or too short, so that it cannot tell.

    ``log`` is its name in the store, ``sha256`` the hash that the store has of it, if any.
    """
    try:
        file = log_file(store, log)
        if sha256 is not None and sha256_of(file) != sha256:
            return None
        sent = Counter(_message_id(packet) for _, packet in records_of(file.read_bytes(), str(file)))
    except (OSError, StoreError, LogError, struct.error):
        return None
    if sent[FOLDCAR_TRUTH]:
        return SIMULATED
    return BUILT if sent[SERVO_OUTPUT_RAW] >= LEAST_PULSES else None


def _message_id(packet: bytes) -> int | None:
    """The id of a MAVLink 2 packet of the car (mavlink.io/en/guide/serialization.html); None of any other."""
    if len(packet) < 10 or packet[0] != 0xFD or packet[5] != CAR_SYSTEM:
        return None
    return int.from_bytes(packet[7:10], "little")
