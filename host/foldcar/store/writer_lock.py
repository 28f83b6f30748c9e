"""The right to write a store, for one process at a time. It follows the file, whatever names lead to it.

The lock is on one byte of the database file, far behind its end and behind the bytes that SQLite itself locks (those
from 2^30 on). It belongs to an open file description (F_OFD_SETLK in fcntl(2)): the kernel drops it when the process
ends, however it ends, and network file systems that lock at all (NFS 4, SMB) pass it on. Readers are not kept out.

flock(2) would not do: NFS makes it a lock on the whole file, which keeps SQLite's readers out. A file beside the
store would not do: it follows the name.
"""

import contextlib
import errno
import os
import struct
from collections.abc import Iterator
from pathlib import Path

from foldcar.store.errors import StoreError

try:
    from fcntl import F_OFD_SETLK, F_WRLCK, fcntl
except ImportError:
    # Windows and macOS: stores are read there, not written.
    HAS_LOCK = False
else:
    HAS_LOCK = True

LOCK_BYTE = 2**62

# Device and inode of the stores that this process writes. Closing any descriptor of a file drops all locks that
# SQLite holds on it in this process (fcntl(2), "Advisory record locking"), so a file that is here is not opened.
_written_here: set[tuple[int, int]] = set()


@contextlib.contextmanager
def writer_lock(path: Path) -> Iterator[None]:
    """Hold the lock of the store at ``path``, whose file is made if there is none. StoreError if it is in use.

    For the reason above, all connections to the store are opened and closed inside the block.
    """
    if not HAS_LOCK:
        raise StoreError(f"{path}: stores are written on Linux only; use a container or WSL (docs/installation.md)")
    in_use = StoreError(f"{path}: another sweep or trial is writing this store; wait for it or use another store")
    if path.exists() and _identity(path.stat()) in _written_here:
        raise in_use
    try:
        descriptor = os.open(path, os.O_RDWR | os.O_CREAT, 0o644)
    except OSError as error:
        raise StoreError(f"{path}: cannot be written: {error.strerror}") from error
    try:
        try:
            fcntl(descriptor, F_OFD_SETLK, _exclusive())
        except OSError as error:
            if error.errno in (errno.EAGAIN, errno.EACCES):
                raise in_use from None
            raise StoreError(f"{path}: cannot be locked on this file system: {error.strerror}") from error
        identity = _identity(os.fstat(descriptor))
        # What was locked must still be the file of that name.
        if not path.exists() or _identity(path.stat()) != identity:
            raise in_use
        _written_here.add(identity)
        try:
            yield
        finally:
            _written_here.discard(identity)
    finally:
        os.close(descriptor)


def is_written_here(path: Path) -> bool:
    """Whether ``path`` still leads to a store that this process writes: it may have been deleted or replaced."""
    try:
        return _identity(path.stat()) in _written_here
    except OSError:
        return False


def check_journal(path: Path) -> None:
    """StoreError if the file has several names (hard links) and its write-ahead log stands beside another of them.

    SQLite names the log after the name that a file was opened by: without it, the last transactions are missing,
    and writing would spoil the file.
    """
    try:
        if path.stat().st_nlink == 1:
            return
        with path.open("rb") as file:
            header = file.read(20)
    except OSError as error:
        raise StoreError(f"{path}: cannot be read: {error.strerror}") from error
    real = path.resolve()
    # Bytes 18 and 19 of the header are 2 in write-ahead mode (sqlite.org/fileformat2.html, 1.3).
    if header[18:20] == b"\2\2" and not real.with_name(real.name + "-wal").exists():
        raise StoreError(
            f"{path}: is written under another name (hard link), or a sweep was killed there: use that name first"
        )


def _exclusive() -> bytes:
    """A ``struct flock`` that asks for LOCK_BYTE: type, whence, start, length, process (0, as such locks want it)."""
    return struct.pack("hhqqi4x", F_WRLCK, os.SEEK_SET, LOCK_BYTE, 1, 0)


def _identity(status: os.stat_result) -> tuple[int, int]:
    return status.st_dev, status.st_ino
