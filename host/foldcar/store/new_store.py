"""A store made whole or not at all: it is written under a temporary name and gets its own at the end, with its logs."""

import contextlib
import os
import shutil
import sqlite3
from collections.abc import Iterable, Iterator
from pathlib import Path

from foldcar.errors import FoldcarError
from foldcar.interrupts import held
from foldcar.output_folder import make_output_folder
from foldcar.store.errors import StoreError, check_name, store_errors
from foldcar.store.log_files import sha256_of
from foldcar.store.migrations import transaction
from foldcar.store.opening import fill_blank


@contextlib.contextmanager
def new_store(store: Path) -> Iterator[tuple[sqlite3.Connection, list[tuple[Path, Path, str | None]]]]:
    """A connection to an empty store that will be ``store``, in one transaction, and a list to be filled.

    The list is of logs to copy beside it: from where, to where, SHA-256. StoreError, with nothing left behind, if there
    is a file of that name, if the logs' names are taken by others, or if it cannot be written.
    """
    check_new(store)
    make_output_folder(store.parent)
    part = store.with_name(f".{store.name}.{os.getpid()}.part")

    def remove() -> None:
        for suffix in ("", "-journal"):
            part.with_name(part.name + suffix).unlink(missing_ok=True)

    logs: list[tuple[Path, Path, str | None]] = []
    with held(remove):
        try:
            part.unlink(missing_ok=True)
            with store_errors(store):
                connection = sqlite3.connect(part, isolation_level=None)
            with contextlib.closing(connection):
                fill_blank(store, connection)
                with store_errors(store), transaction(store, connection):
                    yield connection, logs
            with _logs_beside(logs):
                _give_name(part, store)
        except OSError as error:
            raise StoreError(f"{error.filename or store}: cannot be written: {error.strerror or error}") from error
        finally:
            remove()


def check_new(store: Path) -> None:
    """StoreError if there is a file of that name, or it is no name of a store."""
    check_name(store)
    if os.path.lexists(store):
        raise StoreError(f"{store}: is there already; name a new store")


@contextlib.contextmanager
def _logs_beside(logs: Iterable[tuple[Path, Path, str | None]]) -> Iterator[None]:
    """Copy the logs; those that are new vanish again if the block fails."""
    made: list[Path] = []
    try:
        for source, target, digest in logs:
            if os.path.lexists(target):
                if sha256_of(target) != digest:
                    raise StoreError(f"{target}: is there already, with other contents")
                continue
            target.parent.mkdir(parents=True, exist_ok=True)
            made.append(target)
            shutil.copyfile(source, target)
        yield
    except BaseException:
        for file in made:
            file.unlink(missing_ok=True)
        raise


def _give_name(part: Path, store: Path) -> None:
    try:
        os.link(part, store)
    except FileExistsError:
        raise FoldcarError(f"{store}: is there already; name a new store") from None
    except OSError:
        # A file system without hard links.
        part.rename(store)
