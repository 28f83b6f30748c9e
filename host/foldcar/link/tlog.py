"""Reads and writes .tlog files: each packet of either direction after its time (µs since 1970, 64-bit big-endian).

This is the log format of MAVLink's ground stations: QGroundControl, MAVExplorer and pymavlink read it. Every
packet is passed to the operating system on arrival, so that a killed program loses none.
"""

import os
import struct
import time
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

from foldcar.errors import FoldcarError
from foldcar.link.car_messages import checked_message
from foldcar.link.dialect import load_dialect
from foldcar.outputs import atomic_file

# The time before each packet.
STAMP = struct.Struct(">Q")
# MAVLink's packets: the first byte, and the bytes besides the payload (header and checksum). In version 2, a flag says
# whether a signature follows.
MAVLINK_1, MAVLINK_1_FRAME_BYTES = 0xFE, 8
MAVLINK_2, MAVLINK_2_FRAME_BYTES = 0xFD, 12
SIGNED_FLAG, SIGNATURE_BYTES = 1, 13


class LogError(FoldcarError):
    """A log cannot be read or written, or is invalid; the message names the file."""


class TlogWriter:
    """A log that is being written. A missing folder is created. Raises LogError if the file exists or is not writable."""

    def __init__(self, file: Path) -> None:
        """Create the log file. Raises LogError if it exists or cannot be created."""
        self.file = file
        try:
            file.parent.mkdir(parents=True, exist_ok=True)
            # O_EXCL: only a new file. O_APPEND: always write at its end.
            flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_APPEND
            self._descriptor = os.open(file, flags, 0o644)
        except FileExistsError:
            raise LogError(f"{file}: exists already; logs are never overwritten") from None
        except OSError as error:
            raise LogError(f"{file}: cannot be written: {error.strerror}") from error
        # The number of bytes of all complete records.
        self._size = 0
        # The time of the last packet (µs since 1970).
        self._last_us = 0
        # The time since 1970 at which the monotonic clock was 0. Times are computed from this clock, because somebody may
        # set the system's clock, and that must not change the order of packets.
        self._epoch_ns = time.time_ns() - time.monotonic_ns()

    def now_us(self) -> int:
        """Return the time now (µs since 1970)."""
        return (self._epoch_ns + time.monotonic_ns()) // 1000

    def write(self, packet: bytes, time_us: int | None = None) -> None:
        """Append a packet with ``time_us`` (µs since 1970, default: now); times in a log never decrease.

        Raises LogError if the write fails.
        """
        self._last_us = max(self._last_us, self.now_us() if time_us is None else time_us)
        record = STAMP.pack(self._last_us) + packet
        try:
            written = os.write(self._descriptor, record)
        except OSError as error:
            raise LogError(f"{self.file}: cannot be written: {error.strerror}") from error
        if written < len(record):
            # A partial packet would make the packets after it unreadable.
            os.ftruncate(self._descriptor, self._size)
            raise LogError(f"{self.file}: cannot be written: No space left on device")
        self._size += written

    def close(self) -> None:
        """Synchronise the file to the disk and close it."""
        os.fsync(self._descriptor)
        os.close(self._descriptor)


def read_tlog(file: Path) -> Iterator[tuple[int, Any]]:
    """Yield (time in µs since 1970, message) of a log, up to the first damage. Raises LogError."""
    records, _unread_bytes = records_of(_content(file))
    yield from messages_of(records)


def log_damage(file: Path) -> str | None:
    """Return a line that says how much of a log is damaged; None if it is intact. Raises LogError."""
    _records, unread_bytes = records_of(_content(file))
    if not unread_bytes:
        return None
    return f"{file}: is damaged: its last {unread_bytes} bytes are not packets and are left out"


def _content(file: Path) -> bytes:
    """Return the bytes of a log. Raises LogError."""
    try:
        return file.read_bytes()
    except OSError as error:
        raise LogError(f"{file}: cannot be read: {error.strerror}") from error


def packets_of(file: Path) -> set[bytes]:
    """Return the different packets of a log, up to the first damage. Raises LogError."""
    records, _unread_bytes = records_of(_content(file))
    return {packet for _, packet in records}


def messages_of(records: Iterable[tuple[int, bytes]]) -> Iterator[tuple[int, Any]]:
    """Decode records to (time in µs, message); damaged packets become BAD_DATA messages.

    Messages with impossible numbers are left out.
    """
    mav = load_dialect().MAVLink(None)
    mav.robust_parsing = True
    for time_us, packet in records:
        for message in mav.parse_buffer(packet) or []:
            if checked_message(message) is not None:
                yield time_us, message


def records_of(data: bytes) -> tuple[list[tuple[int, bytes]], int]:
    """Split a log's bytes into records (time in µs, packet), up to the first incomplete one.

    Also returns the number of bytes that remain. The end of a log is damaged if the computer lost power.
    """
    records = []
    offset = 0
    # The length of a packet follows from its first three bytes.
    while offset + STAMP.size + 3 <= len(data):
        packet_start = offset + STAMP.size
        length = _packet_bytes(data, packet_start)
        (time_us,) = STAMP.unpack_from(data, offset)
        if length is None or packet_start + length > len(data):
            break
        records.append((time_us, data[packet_start : packet_start + length]))
        offset = packet_start + length
    return records, len(data) - offset


def trial_start_s(messages: Sequence[Any]) -> float | None:
    """Return when a log's last trial began, in the car's time since boot (s); None if no trial ran."""
    states_after_start = []
    for message in messages:
        # Before its start, a trial has no elapsed time.
        is_state_of_trial = message.get_type() == "FOLDCAR_TRIAL" and message.trial_id
        if is_state_of_trial and 0 < message.elapsed_ms < message.time_boot_ms:
            states_after_start.append(message)
    if not states_after_start:
        return None
    last_trial_id = states_after_start[-1].trial_id
    states_of_last_trial = [state for state in states_after_start if state.trial_id == last_trial_id]
    # The elapsed time stands still after the trial's end. While the car drives, it gives the time of the start; the first
    # message was certainly sent then.
    first_state = states_of_last_trial[0]
    return float(first_state.time_boot_ms - first_state.elapsed_ms) / 1000


def merge_records(file: Path, added_records: Iterable[tuple[int, bytes]]) -> None:
    """Merge more records into a log in order of time, atomically."""
    records, _ = records_of(file.read_bytes())
    with atomic_file(file) as binary:
        for time_us, packet in sorted([*records, *added_records], key=lambda record: record[0]):
            binary.write(STAMP.pack(time_us) + packet)


def _packet_bytes(data: bytes, offset: int) -> int | None:
    """Return the length in bytes of the MAVLink packet at ``offset``; None if no packet begins there.

    A packet begins with a byte that says which version of MAVLink it has. The next byte is the length of its payload.
    """
    version_byte, payload_bytes, flags = data[offset : offset + 3]
    if version_byte == MAVLINK_2:
        signature_bytes = SIGNATURE_BYTES if flags & SIGNED_FLAG else 0
        return MAVLINK_2_FRAME_BYTES + payload_bytes + signature_bytes
    if version_byte == MAVLINK_1:
        return MAVLINK_1_FRAME_BYTES + payload_bytes
    return None
