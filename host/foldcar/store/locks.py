"""Who may write a store, and how long foldcar waits for other programs that lock it.

One process writes at a time: it holds SQLite's exclusive lock of a file beside the store, ``study.db-lock``, which the
system drops when the process ends, however it ends. Symbolic links lead to the same file. Readers are not kept out.
SQLite waits for locks too, but deaf to signals: each of its waits is short (BUSY_S), and what failed is tried again.
"""

import contextlib
import os
import sqlite3
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TypeVar

from foldcar.interrupts import held, is_pending
from foldcar.store.errors import StoreError

# How long SQLite waits, and how long a command does, in seconds.
BUSY_S = 1.0
PATIENCE_S = 600.0

T = TypeVar("T")


@contextlib.contextmanager
def writer_lock(path: Path) -> Iterator[None]:
    """Hold the right to write the store at ``path``. StoreError if another process, or this one, has it."""
    file = Path(f"{os.path.realpath(path)}-lock")
    in_use = StoreError(f"{path}: another sweep or trial is writing this store; wait for it or use another store")
    try:
        file.touch()
        before = file.stat()
        lock = sqlite3.connect(file, timeout=0, isolation_level=None)
    except OSError as error:
        raise StoreError(f"{path}: cannot be written: {error.strerror or error}") from error
    with contextlib.closing(lock):
        try:
            lock.execute("BEGIN EXCLUSIVE")
        except sqlite3.Error as error:
            raise in_use if "locked" in str(error) else StoreError(f"{path}: cannot be locked: {error}") from error
        # Who had it may have deleted the file meanwhile, and a third may have made another one.
        if not leads_to(file, before):
            raise in_use

        def delete() -> None:
            # Windows deletes no file that is open: an empty one stays.
            with contextlib.suppress(OSError):
                file.unlink()

        with held(delete):
            try:
                yield
            finally:
                delete()


def leads_to(path: Path, status: os.stat_result) -> bool:
    """Whether ``path`` still is the name of that file: it may have been deleted or replaced."""
    try:
        return os.path.samestat(path.stat(), status)
    except OSError:
        return False


@contextlib.contextmanager
def transaction(path: Path, connection: sqlite3.Connection) -> Iterator[None]:
    """Everything in the block, or nothing. Waits for other programs; ``path`` is what messages name."""
    patiently(path, lambda: connection.execute("BEGIN IMMEDIATE"))
    try:
        yield
        patiently(path, lambda: connection.execute("COMMIT"))
    finally:
        # Still open only if something went wrong: then nothing of it counts.
        if connection.in_transaction:
            with contextlib.suppress(sqlite3.Error):
                connection.execute("ROLLBACK")


def patiently(path: Path, attempt: Callable[[], T]) -> T:
    """What ``attempt`` gives, tried until no other program locks the store; standard error says that it waits.

    StoreError after PATIENCE_S, and at once if a signal waits to end the program.
    """
    begun = time.monotonic()
    told = False
    while True:
        try:
            return attempt()
        except sqlite3.OperationalError as error:
            # The error's code is known from Python 3.11 on.
            if "locked" not in str(error):
                raise
            if is_pending() or time.monotonic() - begun > PATIENCE_S:
                raise StoreError(f"{path}: is locked by another program; end that and try again") from error
        if not told:
            sys.stderr.write(f"{path}: waiting for another program that has it locked (Ctrl-C stops)\n")
            sys.stderr.flush()
            told = True
