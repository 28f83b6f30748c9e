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
from foldcar.store.salvage import log_damage
from foldcar.store.tables import CHECKSUM, RUN, TABLES, VERSION, VIEWS, Table

# "Fold" in ASCII: tells a store from other SQLite files.
APPLICATION_ID = 0x466F6C64

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
    """A connection that cannot write, to whatever is in the file; StoreError if there is none."""
    check_name(path)
    if not path.exists():
        raise StoreError(f"{path}: no such store")
    if not path.is_file():
        raise StoreError(f"{path}: is no file")
    with store_errors(path):
        return sqlite3.connect(f"{path.resolve().as_uri()}?mode=ro", BUSY_S, uri=True, isolation_level=None)


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
    """StoreError unless it is a store of this version without columns that this foldcar does not know."""
    try:
        (application_id,) = patiently(path, lambda: connection.execute("PRAGMA application_id").fetchone())
        (version,) = connection.execute("PRAGMA user_version").fetchone()
        there = {table: _columns(connection, table) for table in TABLES if table.grows}
    except SQLITE_ERRORS as error:
        journal = beside(path, "-journal")
        if journal.is_file() and journal.stat().st_size:
            raise StoreError(
                f"{path}: a program was killed while it wrote; `foldcar migrate {path}` undoes what is half done"
            ) from error
        raise StoreError(f"{path}: is no foldcar store ({error})") from error
    if application_id != APPLICATION_ID or version < 1:
        raise StoreError(f"{path}: is no foldcar store")
    if version != VERSION:
        raise StoreError(
            f"{path}: is a store of version {version}, this foldcar knows version {VERSION}: use a newer one"
        )
    for table, columns in there.items():
        for name in columns:
            if name not in (*table.names, CHECKSUM):
                what = f'{"metric" if table is RUN else f"{table.name} column"} "{name}"'
                raise StoreError(f"{path}: has the {what}, which this foldcar does not know: use a newer one")


def _columns(connection: sqlite3.Connection, table: Table) -> list[str]:
    return [name for _, name, *_ in connection.execute(f"PRAGMA table_info({table.name})")]


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
        _add_late(path, connection)
        with store_errors(path):
            connection.execute(f"PRAGMA synchronous = {synchronous}")
        yield connection


def migrate_store(path: Path) -> None:
    """Undo what a killed program left half done, and add tables and columns that are newer than the store."""
    check_name(path)
    if not path.is_file():
        raise StoreError(f"{path}: no such store")
    with _connected(path, require_version) as connection:
        _add_late(path, connection)


def _add_late(path: Path, connection: sqlite3.Connection) -> None:
    """Give a store the late tables and columns that it lacks: empty ones."""
    with store_errors(path):
        there = {table.name: _columns(connection, table) for table in TABLES}
        for table in TABLES:
            if table.late and not there[table.name]:
                connection.execute(table.sql)
                there[table.name] = list(table.names)
        missing = [
            f"ALTER TABLE {table.name} ADD COLUMN {column.sql}"
            for table in TABLES
            for column in table.columns
            if column.late and column.name not in there[table.name]
        ]
        if missing:
            with transaction(path, connection):
                for statement in (*(f"DROP VIEW IF EXISTS {name}" for name in VIEWS), *missing, *VIEWS.values()):
                    connection.execute(statement)


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
        for statement in (*(table.sql for table in TABLES), *VIEWS.values()):
            connection.execute(statement)
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
