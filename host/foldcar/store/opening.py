"""How a store's file is made, opened and refused.

A store is one SQLite file. While it is written, it is in write-ahead mode with two files beside it, where the file
system has shared memory; whoever ends turns it back into a single file. Those who only read change nothing and lock
nobody out: they read a copy, which SQLite keeps in memory and in a temporary file that vanishes with the connection.
"""

import contextlib
import os
import sqlite3
from collections.abc import Callable, Iterator
from pathlib import Path

from foldcar.interrupts import held, raised
from foldcar.outputs import make_output_folder
from foldcar.store.connection import BUSY_S, leads_to, patiently, transaction, writer_lock
from foldcar.store.errors import SQLITE_ERRORS, StoreError, check_name, store_errors
from foldcar.store.log_files import give_name, logs_beside
from foldcar.store.migrations import VERSION, add_late, create_tables, migrate
from foldcar.store.salvage import log_damage
from foldcar.store.tables import CHECKSUM, RUN, TABLES

# "Fold" in ASCII: tells a store from other SQLite files, and UNRELEASED ("Fcar") from those of no release.
APPLICATION_ID = 0x466F6C64
UNRELEASED = 0x46636172

# Larger stores, of some ten million runs, are read where they are.
MOST_COPIED_BYTES = 2**30


def open_reading(path: Path) -> sqlite3.Connection:
    """A connection that sees one moment of an existing store and never writes; StoreError if it is none."""
    with contextlib.ExitStack() as stack:
        connection = stack.enter_context(contextlib.closing(connect_reading(path)))
        refuse_damaged_log(path)
        require_version(path, connection)
        # Without room for a copy a store is read where it is, too.
        with contextlib.suppress(StoreError):
            if path.stat().st_size <= MOST_COPIED_BYTES:
                return _copied(path, connection)
        # A reader of so large a store keeps writers waiting, unless one was there before it.
        with store_errors(path):
            connection.execute("BEGIN")
        stack.pop_all()
        return connection


def _copied(path: Path, connection: sqlite3.Connection) -> sqlite3.Connection:
    with store_errors(path), contextlib.ExitStack() as stack:
        copy = stack.enter_context(contextlib.closing(sqlite3.connect("", isolation_level=None)))
        # With a function to call, signals are heard while SQLite waits for another program.
        connection.backup(copy, progress=lambda status, remaining, total: None)
        copy.execute("PRAGMA query_only = ON")
        stack.pop_all()
    return copy


def connect_reading(path: Path) -> sqlite3.Connection:
    """A connection that cannot write, to whatever version of a store; StoreError if there is no file."""
    check_name(path)
    if not path.exists():
        raise StoreError(f"{path}: no such store")
    if not path.is_file():
        raise StoreError(f"{path}: is no file")
    _check_names(path)
    with store_errors(path):
        return sqlite3.connect(f"{path.resolve().as_uri()}?mode=ro", BUSY_S, uri=True, isolation_level=None)


def _check_names(path: Path) -> None:
    """StoreError if the file has several names (hard links) and its write-ahead log stands beside another of them.

    SQLite names the log after the name that a file was opened by: without it, the last transactions are missing.
    """
    try:
        if path.stat().st_nlink == 1:
            return
        with path.open("rb") as file:
            header = file.read(20)
    except OSError as error:
        raise StoreError(f"{path}: cannot be read: {error.strerror}") from error
    # Bytes 18 and 19 of the header are 2 in write-ahead mode (sqlite.org/fileformat2.html, 1.3).
    if header[18:20] == b"\2\2" and not beside(path, "-wal").exists():
        raise StoreError(
            f"{path}: is written under another name (hard link), or a sweep was killed there: use that name first"
        )


def beside(path: Path, suffix: str) -> Path:
    """The file that SQLite has beside a store: ``-wal`` or ``-journal``."""
    return Path(f"{os.path.realpath(path)}{suffix}")


def refuse_damaged_log(path: Path) -> None:
    """StoreError if the log beside the store is damaged: whoever opens the store would lose transactions."""
    damage = log_damage(beside(path, "-wal"))
    if damage is not None:
        where = f"{path}: its write-ahead log {path.name}-wal"
        raise StoreError(f"{where}: {damage}; `foldcar repair` saves what is whole")


def require_store(path: Path) -> None:
    """StoreError if there is no store that this foldcar can read. For commands that write, but make no store."""
    with contextlib.closing(connect_reading(path)) as connection:
        require_version(path, connection)


def require_version(path: Path, connection: sqlite3.Connection) -> None:
    """StoreError unless it is a store of this version."""
    version = store_version(path, connection)
    if version < VERSION:
        raise StoreError(f"{path}: is of version {version}; `foldcar migrate {path}` brings it to {VERSION}")


def store_version(path: Path, connection: sqlite3.Connection) -> int:
    """The version of a store, this one's or an older one; StoreError if it is newer, or no store."""
    try:
        (application_id,) = patiently(path, lambda: connection.execute("PRAGMA application_id").fetchone())
        (version,) = connection.execute("PRAGMA user_version").fetchone()
        growing = [table for table in TABLES if table.grows]
        told = {table: connection.execute(f"PRAGMA table_info({table.name})").fetchall() for table in growing}
    except SQLITE_ERRORS as error:
        journal = beside(path, "-journal")
        if journal.is_file() and journal.stat().st_size:
            raise StoreError(
                f"{path}: a program was killed while it wrote; `foldcar migrate {path}` undoes what is half done"
            ) from error
        raise StoreError(f"{path}: is no foldcar store ({error})") from error
    if application_id == UNRELEASED:
        raise StoreError(f"{path}: was made before foldcar's first release, which cannot read it: sweep again")
    if application_id != APPLICATION_ID or version < 1:
        raise StoreError(f"{path}: is no foldcar store")
    if version > VERSION:
        raise StoreError(f"{path}: is a store of version {version}, this foldcar knows versions up to {VERSION}")
    for table, columns in told.items():
        unknown = [name for _, name, *_ in columns if name not in (*table.names, CHECKSUM)]
        if unknown:
            what = f'{"metric" if table is RUN else f"{table.name} column"} "{unknown[0]}"'
            raise StoreError(f"{path}: has the {what}, which this foldcar does not know: use a newer one")
    return int(version)


@contextlib.contextmanager
def writing(path: Path, synchronous: str = "NORMAL") -> Iterator[sqlite3.Connection]:
    """A connection to the store at ``path``; made, with its folder, if need be. StoreError if it is in use.

    A commit survives the death of the program; with ``synchronous`` FULL also a power cut.
    """
    check_name(path)
    if path.is_dir():
        raise StoreError(f"{path}: is a folder, not a store")
    make_output_folder(path.parent)
    with _connected(path, _blank_or_current) as connection:
        if _blank_or_current(path, connection):
            fill_blank(path, connection)
        add_late(path, connection)
        with store_errors(path):
            connection.execute(f"PRAGMA synchronous = {synchronous}")
        yield connection


def migrate_store(path: Path) -> None:
    """Bring a store to this version, with a copy of what it was beside it; undo what a killed program left half done."""
    check_name(path)
    if not path.is_file():
        raise StoreError(f"{path}: no such store")
    with _connected(path, store_version) as connection:
        version = store_version(path, connection)
        if version < VERSION:
            migrate(path, connection, version)
        add_late(path, connection)


def _blank_or_current(path: Path, connection: sqlite3.Connection) -> bool:
    """Whether the file is new, or as a creation that was cut short leaves it; StoreError if it is another's."""
    try:
        (tables,) = patiently(path, lambda: connection.execute("SELECT count(*) FROM sqlite_master").fetchone())
        (application_id,) = connection.execute("PRAGMA application_id").fetchone()
    except SQLITE_ERRORS as error:
        raise StoreError(f"{path}: is no foldcar store ({error})") from error
    if tables == 0 and application_id == 0:
        return True
    require_version(path, connection)
    return False


def fill_blank(path: Path, connection: sqlite3.Connection) -> None:
    """Make an empty SQLite file an empty store of this version."""
    with store_errors(path), transaction(path, connection):
        create_tables(connection)
        connection.execute(f"PRAGMA application_id = {APPLICATION_ID}")
        connection.execute(f"PRAGMA user_version = {VERSION}")


@contextlib.contextmanager
def _connected(path: Path, accept: Callable[[Path, sqlite3.Connection], object]) -> Iterator[sqlite3.Connection]:
    """A connection to a file that ``accept`` does not refuse, of the only process that writes it."""
    with writer_lock(path), contextlib.ExitStack() as stack:
        if path.exists() and path.stat().st_nlink > 1:
            raise StoreError(f"{path}: has another name (hard link), which SQLite cannot write safely: write a copy")
        refuse_damaged_log(path)
        with raised():
            connection = _open_writing(path, accept)
            status = path.stat()
            stack.enter_context(held(lambda: _close_writing(path, connection, status)))
        try:
            yield connection
        finally:
            _close_writing(path, connection, status)


def _open_writing(path: Path, accept: Callable[[Path, sqlite3.Connection], object]) -> sqlite3.Connection:
    """In write-ahead mode; with a rollback journal where the file system has no shared memory."""
    with store_errors(path), contextlib.ExitStack() as stack:
        connection = sqlite3.connect(path, BUSY_S, isolation_level=None)
        stack.callback(lambda: connection.close())
        accept(path, connection)
        try:
            patiently(path, lambda: connection.execute("PRAGMA journal_mode = WAL").fetchone())
            connection.execute("SELECT count(*) FROM sqlite_master").fetchone()
        except sqlite3.OperationalError:
            connection.close()
            connection = sqlite3.connect(path, BUSY_S, isolation_level=None)
            # A connection that lets nobody else in needs no shared memory to leave the mode.
            connection.execute("PRAGMA locking_mode = EXCLUSIVE")
            patiently(path, lambda: connection.execute("PRAGMA journal_mode = DELETE").fetchone())
            connection.execute("PRAGMA locking_mode = NORMAL")
            connection.execute("SELECT count(*) FROM sqlite_master").fetchone()
        _overwrite_deleted(connection)
        stack.pop_all()
        return connection


def _overwrite_deleted(connection: sqlite3.Connection) -> None:
    """Deleted rows are overwritten, so that what is saved of a damaged store is never one of them."""
    connection.execute("PRAGMA secure_delete = ON")


def _close_writing(path: Path, connection: sqlite3.Connection, status: os.stat_result) -> None:
    """Close, leaving a single file if nobody reads it at the moment."""
    # An interrupt may have left a query half read, which would keep the mode: closing ends every query.
    connection.close()
    # To open the name of a file that was deleted would make a new one, or change one that is another.
    if leads_to(path, status):
        with contextlib.suppress(sqlite3.Error), contextlib.closing(sqlite3.connect(path)) as last:
            last.execute("PRAGMA journal_mode = DELETE")


@contextlib.contextmanager
def new_store(store: Path) -> Iterator[tuple[sqlite3.Connection, list[tuple[Path, Path, str | None]]]]:
    """A connection to an empty store that will be ``store``, with all that is in it or not at all, and a list to fill.

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
                connection = sqlite3.connect(part, isolation_level=None, uri=True)
            with contextlib.closing(connection):
                _overwrite_deleted(connection)
                fill_blank(store, connection)
                with store_errors(store):
                    yield connection, logs
            with logs_beside(logs):
                give_name(part, store)
        except OSError as error:
            raise StoreError(f"{error.filename or store}: cannot be written: {error.strerror or error}") from error
        finally:
            remove()


def check_new(store: Path) -> None:
    """StoreError if there is a file of that name, or it is no name of a store."""
    check_name(store)
    if os.path.lexists(store):
        raise StoreError(f"{store}: is there already; name a new store")
