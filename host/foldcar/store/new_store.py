"""Makes the file of a new store whole or not at all: under a temporary name, which is its own only at the end."""

import contextlib
import os
import sqlite3
from collections.abc import Iterator
from pathlib import Path

from foldcar.errors import FoldcarError
from foldcar.interrupts import held
from foldcar.output_folder import make_output_folder
from foldcar.store.errors import StoreError, store_errors
from foldcar.store.migrations import transaction
from foldcar.store.opening import fill_blank


@contextlib.contextmanager
def new_store(store: Path, what: str) -> Iterator[sqlite3.Connection]:
    """A transaction on an empty store that gets the name ``store`` at the end of the block, if nothing went wrong.

    StoreError if there is something of that name, saying that ``what`` needs a new store, or if it cannot be written.
    """
    taken = StoreError(f"{store}: is there already; {what} a new store")
    if os.path.lexists(store):
        raise taken
    make_output_folder(store.parent)
    part = store.with_name(f".{store.name}.{os.getpid()}.part")

    def tidy() -> None:
        for suffix in ("", "-journal"):
            part.with_name(part.name + suffix).unlink(missing_ok=True)

    try:
        with held(tidy):
            tidy()
            with store_errors(store):
                connection = sqlite3.connect(part, isolation_level=None)
            with contextlib.closing(connection):
                fill_blank(store, connection)
                with store_errors(store), transaction(connection):
                    yield connection
            _give_name(part, store, taken)
    except OSError as error:
        raise StoreError(f"{error.filename or store}: cannot be written: {error.strerror or error}") from error
    finally:
        tidy()


def _give_name(part: Path, store: Path, taken: FoldcarError) -> None:
    try:
        os.link(part, store)
    except FileExistsError:
        raise taken from None
    except OSError:
        # A file system without hard links.
        part.rename(store)
