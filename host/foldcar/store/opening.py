"""How a store's file is made, opened, brought up to this version and refused.

A store is one SQLite file. While it is written, it is in write-ahead mode with two files beside it, where the file
system has shared memory; whoever ends turns it back into a single file. Those who only read change nothing and lock
nobody out: they read a copy, migrated if the store is of an older version, which SQLite keeps in memory and in a
temporary file that vanishes with the connection.
"""

import contextlib
import sqlite3
import sys
from collections.abc import Iterator
from pathlib import Path

from foldcar.interrupts import held, raised
from foldcar.output_folder import make_output_folder
from foldcar.store.errors import SQLITE_ERRORS, StoreError, check_name, store_errors
from foldcar.store.migrations import VERSION, add_metrics, copy_beside, create_tables, migrate, transaction
from foldcar.store.patience import BUSY_S, patiently
from foldcar.store.tables import CHECKSUM, RUN
from foldcar.store.write_ahead_log import refuse_damaged_log
from foldcar.store.writer_lock import check_journal, is_written_here, writer_lock

# "Fcar" in ASCII: tells a store from other SQLite files.
APPLICATION_ID = 0x46636172

# Larger stores, of some ten million runs, are read where they are.
MOST_COPIED_BYTES = 2**30


def open_reading(path: Path) -> sqlite3.Connection:
    """A connection that sees one moment of an existing store and never writes; StoreError if it is none."""
    with contextlib.closing(connect_reading(path)) as connection:
        refuse_damaged_log(path)
        is_older = store_version(path, connection) < VERSION
        if is_older:
            return _copied(path, connection, is_older)
        # Without room for a copy a store is read where it is, too.
        with contextlib.suppress(StoreError):
            if path.stat().st_size <= MOST_COPIED_BYTES:
                return _copied(path, connection, is_older)
    # A reader of so large a store keeps writers waiting, unless one was there before it.
    connection = connect_reading(path)
    try:
        with store_errors(path):
            connection.execute("BEGIN")
    except BaseException:
        connection.close()
        raise
    return connection


def _copied(path: Path, connection: sqlite3.Connection, is_older: bool) -> sqlite3.Connection:
    """A copy of the store, brought up to this version."""
    with store_errors(path):
        copy = sqlite3.connect("", isolation_level=None)
    try:
        with store_errors(path):
            # With a function to call, signals are heard while SQLite waits for another program.
            connection.backup(copy, progress=lambda status, remaining, total: None)
        if is_older:
            migrate(path, copy)
        with store_errors(path):
            copy.execute("PRAGMA query_only = ON")
    except BaseException:
        copy.close()
        raise
    return copy


def connect_reading(path: Path) -> sqlite3.Connection:
    """A connection that cannot write, to whatever version of a store; StoreError if there is no file."""
    check_name(path)
    if not path.exists():
        raise StoreError(f"{path}: no such store")
    if not path.is_file():
        raise StoreError(f"{path}: is no file")
    check_journal(path)
    with store_errors(path):
        return sqlite3.connect(f"{path.resolve().as_uri()}?mode=ro", BUSY_S, uri=True, isolation_level=None)


def require_store(path: Path) -> None:
    """StoreError if there is no store that this foldcar can read. For commands that write, but make no store."""
    with contextlib.closing(connect_reading(path)) as connection:
        store_version(path, connection)


def undo_half_done(path: Path) -> None:
    """Undo the transaction that a killed program left, without a write-ahead log, in a file. StoreError."""
    if path.is_file() and _journal_is_left(path):
        with writer_lock(path), store_errors(path), contextlib.closing(sqlite3.connect(path)) as connection:
            # SQLite does it before it reads anything.
            connection.execute("SELECT count(*) FROM sqlite_master").fetchone()


def _journal_is_left(path: Path) -> bool:
    journal = path.resolve().with_name(f"{path.resolve().name}-journal")
    return journal.is_file() and journal.stat().st_size > 0


@contextlib.contextmanager
def writing(path: Path) -> Iterator[sqlite3.Connection]:
    """A connection to the store at ``path``; made, with its folder, if need be. StoreError if it is in use.

    A store of an older version is migrated first; a line on standard error says so.
    """
    check_name(path)
    if path.is_dir():
        raise StoreError(f"{path}: is a folder, not a store")
    make_output_folder(path.parent)
    with writer_lock(path), contextlib.ExitStack() as stack:
        with raised():
            connection = _open_writing(path)
            stack.enter_context(held(lambda: _close_writing(path, connection)))
        try:
            yield connection
        finally:
            _close_writing(path, connection)


def store_version(path: Path, connection: sqlite3.Connection) -> int:
    """The version of a store, this one's or an older one; StoreError if it is newer, or no store."""
    try:
        (application_id,) = patiently(path, lambda: connection.execute("PRAGMA application_id").fetchone())
        (version,) = connection.execute("PRAGMA user_version").fetchone()
        columns = [name for _, name, *_ in connection.execute("PRAGMA table_info(run)")]
    except SQLITE_ERRORS as error:
        if _journal_is_left(path):
            raise StoreError(
                f"{path}: a program was killed while it wrote; `foldcar migrate {path}` undoes what is half done"
            ) from error
        raise StoreError(f"{path}: is no foldcar store ({error})") from error
    if application_id != APPLICATION_ID:
        raise StoreError(f"{path}: is no foldcar store")
    if not 1 <= version <= VERSION:
        raise StoreError(f"{path}: is a store of version {version}, this foldcar knows versions 1 to {VERSION}")
    unknown = [name for name in columns if name not in (*RUN.names, CHECKSUM)]
    if unknown:
        raise StoreError(f'{path}: has the metric "{unknown[0]}", which this foldcar does not know: use a newer one')
    return int(version)


def fill_blank(path: Path, connection: sqlite3.Connection) -> None:
    """Make an empty SQLite file an empty store of this version."""
    with store_errors(path), transaction(path, connection):
        create_tables(connection)
        connection.execute(f"PRAGMA application_id = {APPLICATION_ID}")
        connection.execute(f"PRAGMA user_version = {VERSION}")


def _open_writing(path: Path) -> sqlite3.Connection:
    check_journal(path)
    refuse_damaged_log(path)
    with store_errors(path):
        connection = sqlite3.connect(path, BUSY_S, isolation_level=None)
    try:
        if _is_blank(path, connection):
            fill_blank(path, connection)
        version = store_version(path, connection)
        backup = copy_beside(path, connection, version) if version < VERSION else None
    except BaseException:
        connection.close()
        raise
    try:
        with store_errors(path):
            connection = _with_log(path, connection)
        if backup is None:
            add_metrics(path, connection)
        else:
            _migrate_in_place(path, connection, version, backup)
        with store_errors(path):
            # A commit survives the death of the program; only a power cut may lose the last ones.
            connection.execute("PRAGMA synchronous = NORMAL")
    except BaseException:
        _close_writing(path, connection)
        raise
    return connection


def _with_log(path: Path, connection: sqlite3.Connection) -> sqlite3.Connection:
    """The connection in write-ahead mode; one with a rollback journal where the file system has no shared memory."""
    try:
        patiently(path, lambda: connection.execute("PRAGMA journal_mode = WAL").fetchone())
        connection.execute("SELECT count(*) FROM sqlite_master").fetchone()
        return connection
    except sqlite3.OperationalError:
        connection.close()
    connection = sqlite3.connect(path, BUSY_S, isolation_level=None)
    try:
        # A connection that lets nobody else in needs no shared memory to leave the mode.
        connection.execute("PRAGMA locking_mode = EXCLUSIVE")
        patiently(path, lambda: connection.execute("PRAGMA journal_mode = DELETE").fetchone())
        connection.execute("PRAGMA locking_mode = NORMAL")
        connection.execute("SELECT count(*) FROM sqlite_master").fetchone()
    except BaseException:
        connection.close()
        raise
    return connection


def _migrate_in_place(path: Path, connection: sqlite3.Connection, version: int, backup: Path) -> None:
    try:
        migrate(path, connection)
    except BaseException:
        # The store is as it was, so that its copy is of no use.
        backup.unlink(missing_ok=True)
        raise
    # Without what the old tables leave free. That is for looks only: a disk too full for it does not matter.
    with contextlib.suppress(sqlite3.Error):
        connection.execute("VACUUM")
    sys.stderr.write(f"{path}: migrated from version {version} to {VERSION}; as it was: {backup}\n")


def _close_writing(path: Path, connection: sqlite3.Connection) -> None:
    """Close, leaving a single file if nobody reads it at the moment."""
    # An interrupt may have left a query half read, which would keep the mode: closing ends every query.
    connection.close()
    if not is_written_here(path):
        # To open the name would make a new file, or change one that is another.
        return
    with contextlib.suppress(sqlite3.Error), contextlib.closing(sqlite3.connect(path)) as last:
        last.execute("PRAGMA journal_mode = DELETE")


def _is_blank(path: Path, connection: sqlite3.Connection) -> bool:
    """Whether the file is new, or as a creation that was cut short leaves it."""
    try:
        (tables,) = patiently(path, lambda: connection.execute("SELECT count(*) FROM sqlite_master").fetchone())
        (application_id,) = connection.execute("PRAGMA application_id").fetchone()
    except SQLITE_ERRORS as error:
        raise StoreError(f"{path}: is no foldcar store ({error})") from error
    return bool(tables == 0 and application_id == 0)
