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


def check_name(store: Path) -> None:
    """StoreError if SQLite takes the name for something else than a file's: it would keep nothing, or elsewhere."""
    if str(store) == ":memory:" or str(store).startswith("file:"):
        raise StoreError(f"{store}: is no file name to SQLite: give the store another, such as study.db")


@contextlib.contextmanager
def store_errors(path: Path) -> Iterator[None]:
    """Turns SQLITE_ERRORS into StoreErrors that name the file."""
    try:
        yield
    except SQLITE_ERRORS as error:
        raise StoreError(f"{path}: {error}") from error
