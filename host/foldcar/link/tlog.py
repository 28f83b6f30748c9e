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


class LogError(FoldcarError):
    """A log cannot be read or written, or is invalid; the message names the file."""


class TlogWriter:
    """A log that is being written. A missing folder is created. Raises LogError if the file exists or is not writable."""

    def __init__(self, file: Path) -> None:
        self.file = file
        try:
            file.parent.mkdir(parents=True, exist_ok=True)
            self._descriptor = os.open(file, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_APPEND, 0o644)
        except FileExistsError:
            raise LogError(f"{file}: exists already; logs are never overwritten") from None
        except OSError as error:
            raise LogError(f"{file}: cannot be written: {error.strerror}") from error
        self._size = 0
        self._last_us = 0
        # Added to the monotonic clock, because steps of the wall clock must not change the order of packets.
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
    """Return when a log's trial began, in the car's time since boot (s); None if no trial ran."""
    running = []
    for message in messages:
        if message.get_type() != "FOLDCAR_TRIAL" or not message.trial_id:
            continue
        # Before its start, a trial has no elapsed time.
        if 0 < message.elapsed_ms < message.time_boot_ms:
            running.append(message)
    if not running:
        return None
    # The first message of the last trial counts, because the elapsed time stands still after the trial's end.
    last_trial = [message for message in running if message.trial_id == running[-1].trial_id]
    first_message = last_trial[0]
    return float(first_message.time_boot_ms - first_message.elapsed_ms) / 1000


def merge_records(file: Path, added_records: Iterable[tuple[int, bytes]]) -> None:
    """Merge more records into a log in order of time, atomically."""
    records, _ = records_of(file.read_bytes())
    with atomic_file(file) as binary:
        for time_us, packet in sorted([*records, *added_records], key=lambda record: record[0]):
            binary.write(STAMP.pack(time_us) + packet)


def _packet_bytes(data: bytes, offset: int) -> int | None:
    """Return the length in bytes of the MAVLink packet at ``offset``; None if no packet begins there.

    MAVLink 2 (0xFD) has 12 bytes besides the payload, and 13 for a signature; MAVLink 1 (0xFE) has 8.
    """
    first_byte, payload_bytes, flags = data[offset : offset + 3]
    if first_byte == 0xFD:
        signature_bytes = 13 if flags & 1 else 0
        return 12 + payload_bytes + signature_bytes
    if first_byte == 0xFE:
        return 8 + payload_bytes
    return None
