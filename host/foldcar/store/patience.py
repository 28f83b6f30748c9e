"""Waits for other programs that lock a store: SQLite's own shell, a viewer of databases, a reader of a very large store.

SQLite waits too, but deaf to signals: each of its waits is short (BUSY_S), and what failed is tried again.
"""

import sqlite3
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

from foldcar.interrupts import is_pending
from foldcar.store.errors import StoreError

# How long SQLite waits, and how long a command does, in seconds.
BUSY_S = 1.0
PATIENCE_S = 600.0

T = TypeVar("T")


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
