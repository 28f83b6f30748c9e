"""Logs of the link: each packet, of either direction, behind its time as a big-endian number of µs since 1970.

This is the .tlog of MAVLink's ground stations: `mavlogdump.py`, MAVExplorer and QGroundControl open it. Every
packet is handed to the system as it comes, so a program that is killed loses none.
"""

import os
import struct
import time
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from foldcar.atomic_file import atomic_file
from foldcar.errors import FoldcarError
from foldcar.mavlink_dialect import load_dialect

STAMP = struct.Struct(">Q")


class LogError(FoldcarError):
    """The log cannot be written any more, or is none; the message names the file."""


class TlogWriter:
    """A log that is being written. The file must not exist; its folder is made."""

    def __init__(self, file: Path) -> None:
        self.file = file
        try:
            file.parent.mkdir(parents=True, exist_ok=True)
            self._descriptor = os.open(file, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_APPEND, 0o644)
        except FileExistsError:
            raise LogError(f"{file}: is there already; logs are never overwritten") from None
        except OSError as error:
            raise LogError(f"{file}: cannot be written: {error.strerror}") from error
        self._size = 0

    def write(self, packet: bytes, time_us: int | None = None) -> None:
        """Append a packet, received or sent at ``time_us`` (now); LogError if the disk does not take it."""
        record = STAMP.pack(time.time_ns() // 1000 if time_us is None else time_us) + packet
        try:
            written = os.write(self._descriptor, record)
        except OSError as error:
            raise LogError(f"{self.file}: cannot be written: {error.strerror}") from error
        if written < len(record):
            # Half a packet would spoil what follows it.
            os.ftruncate(self._descriptor, self._size)
            raise LogError(f"{self.file}: cannot be written: No space left on device")
        self._size += written

    def close(self) -> None:
        """Have the file on the disk itself, and close it."""
        os.fsync(self._descriptor)
        os.close(self._descriptor)


def read_tlog(file: Path) -> Iterator[tuple[int, Any]]:
    """The messages of a log with their times in µs since 1970, up to where the file ends or was cut off."""
    try:
        data = file.read_bytes()
    except OSError as error:
        raise LogError(f"{file}: cannot be read: {error.strerror}") from error
    yield from messages_of(records_of(data, str(file)))


def messages_of(records: Iterable[tuple[int, bytes]]) -> Iterator[tuple[int, Any]]:
    """The messages of records, damaged ones as BAD_DATA."""
    mav = load_dialect().MAVLink(None)
    mav.robust_parsing = True
    for time_us, packet in records:
        for message in mav.parse_buffer(packet) or []:
            yield time_us, message


def records_of(data: bytes, name: str) -> list[tuple[int, bytes]]:
    """Times and packets of a log's bytes, the last one left out if it is cut off. LogError, with ``name``."""
    records = []
    at = 0
    while at + STAMP.size + 3 <= len(data):
        (time_us,) = STAMP.unpack_from(data, at)
        at += STAMP.size
        length = _packet_bytes(data, at)
        if length is None:
            raise LogError(f"{name}: byte {at}: no MAVLink packet where one should begin")
        if at + length > len(data):
            break
        records.append((time_us, data[at : at + length]))
        at += length
    return records


def merge_records(file: Path, more: Iterable[tuple[int, bytes]]) -> None:
    """Put more records into a log, in order of time; whole or not at all."""
    records = records_of(file.read_bytes(), str(file))
    with atomic_file(file) as binary:
        for time_us, packet in sorted([*records, *more], key=lambda record: record[0]):
            binary.write(STAMP.pack(time_us) + packet)


def _packet_bytes(data: bytes, at: int) -> int | None:
    """How long the packet at ``at`` is: header, payload, checksum, signature if there is one."""
    if data[at] == 0xFD:
        return 12 + data[at + 1] + (13 if data[at + 2] & 1 else 0)
    return 8 + data[at + 1] if data[at] == 0xFE else None
