"""What can go wrong with a store, as errors of one line that name the file."""

import contextlib
import sqlite3
from collections.abc import Iterator
from pathlib import Path

from foldcar.errors import FoldcarError


class StoreError(FoldcarError):
    """No store, another version, in use, damaged, or a disk that does not take it; the message names the file."""


@contextlib.contextmanager
def store_errors(path: Path) -> Iterator[None]:
    """Turns SQLite's errors, and those of texts that are none, into StoreErrors that name the file."""
    try:
        yield
    except (sqlite3.Error, UnicodeError, OverflowError) as error:
        raise StoreError(f"{path}: {error}") from error
