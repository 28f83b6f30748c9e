"""What can go wrong with a store, as errors of one line that name the file."""

import contextlib
import sqlite3
from collections.abc import Iterator
from pathlib import Path

from foldcar.errors import FoldcarError

# What Python's sqlite3 raises: damaged texts, in messages too, are UnicodeErrors, and numbers too large OverflowErrors.
SQLITE_ERRORS = (sqlite3.Error, UnicodeError, OverflowError)


class StoreError(FoldcarError):
    """No store, another version, in use, damaged, or a disk that does not take it; the message names the file."""


@contextlib.contextmanager
def store_errors(path: Path, prefix: str = "") -> Iterator[None]:
    """Turns SQLITE_ERRORS into StoreErrors that name the file; ``prefix`` stands before what SQLite says."""
    try:
        yield
    except SQLITE_ERRORS as error:
        # The error's code is known from Python 3.11 on.
        if isinstance(error, sqlite3.OperationalError) and "locked" in str(error):
            raise StoreError(f"{path}: is locked by another program; end that and try again") from error
        raise StoreError(f"{path}: {prefix}{error}") from error
