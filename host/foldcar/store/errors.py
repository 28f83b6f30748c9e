"""Errors of a store, as messages of one line that name the file."""

import contextlib
import sqlite3
from collections.abc import Iterator
from pathlib import Path

from foldcar.errors import FoldcarError

# Exceptions of Python's sqlite3, which raises UnicodeError for damaged text and OverflowError for too large numbers.
SQLITE_ERRORS = (sqlite3.Error, UnicodeError, OverflowError)


class StoreError(FoldcarError):
    """A store is missing, damaged, in use, of another version or cannot be written; the message names the file."""


@contextlib.contextmanager
def store_errors(path: Path, prefix: str = "") -> Iterator[None]:
    """Convert SQLITE_ERRORS of the block to StoreErrors: ``path``, then ``prefix``, then SQLite's message."""
    try:
        yield
    except SQLITE_ERRORS as error:
        # Python 3.10 does not provide the error's code, so the message is searched.
        if isinstance(error, sqlite3.OperationalError) and "locked" in str(error):
            raise StoreError(f"{path}: is locked by another program; close that program and try again") from error
        # If a program was stopped while it wrote to the store, SQLite must write a file beside the store before anybody
        # can read it.
        if isinstance(error, sqlite3.OperationalError) and "unable to open" in str(error):
            raise StoreError(
                f"{path}: cannot be opened; if its folder cannot be written to, copy the store, together with the file "
                f"{path.name}-wal if there is one, to a folder that can"
            ) from error
        raise StoreError(f"{path}: {prefix}{error}") from error
