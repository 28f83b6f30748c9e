"""Creates and opens a store's file, lets one process at a time write it, and refuses other files.

A store is one SQLite file. While it is written, it is in write-ahead mode with two files beside it (a rollback journal
where the file system has no shared memory), and the writer holds SQLite's exclusive lock of ``study.db-lock``, which
the system releases when the process ends, even if it is killed. When the writer closes, the store is a single file again.
Readers copy the store into a temporary database, which is deleted with the connection, so that writers need not wait.
"""

import contextlib
import os
import sqlite3
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from foldcar.outputs import make_output_folder
from foldcar.store.errors import StoreError, store_errors
from foldcar.store.rows import key_text
from foldcar.store.tables import LIMITS, OLDEST_TRIALS, TABLES, VERSION, VIEWS, create_tables
from foldcar.typed import did_you_mean_file

# "Fold" in ASCII: distinguishes a store from other SQLite files.
APPLICATION_ID = 0x466F6C64
# How long SQLite waits for another program that has the store locked, in seconds.
BUSY_S = 10.0
# How long a writer waits for the lock of another writer, in seconds. Two that begin together release it sooner.
LOCK_S = 0.2
# Stores of more bytes, some ten million runs, are read in place.
MAX_COPIED_BYTES = 2**30
# How many bytes of a file are searched to recognise a listing.
MAX_LISTING_BYTES = 2**20


def open_reading(path: Path) -> sqlite3.Connection:
    """Return a read-only connection to an existing store, in which later changes by other programs are not seen.

    The connection is to a copy of the store in a temporary database, which is checked for damage. If the store has more
    than MAX_COPIED_BYTES, it is not copied; the connection then stays in one transaction. Raises StoreError if the file
    is not a store, or is damaged.
    """
    connection = connect_reading(path)
    with _closed_on_error(connection), store_errors(path):
        if path.stat().st_size > MAX_COPIED_BYTES:
            connection.execute("BEGIN")
            return connection
        copy = _checked_copy(path, connection)
    connection.close()
    return copy


def _checked_copy(path: Path, connection: sqlite3.Connection) -> sqlite3.Connection:
    """Copy a store into a temporary database, and return a read-only connection to it.

    Raises StoreError if the copy is damaged.
    """
    copy = sqlite3.connect("", isolation_level=None)
    with _closed_on_error(copy):
        connection.backup(copy)
        copy.execute("PRAGMA query_only = ON")
        # SQLite checks structure, types, required values and choices, so that later code can rely on them.
        (first_damage,) = copy.execute("PRAGMA quick_check(1)").fetchone()
        if first_damage != "ok":
            raise StoreError(f"{path}: is damaged: {first_damage}; `foldcar check {path}` lists all damage")
        require_numbers_within_limits(path, copy)
    return copy


@contextlib.contextmanager
def _closed_on_error(connection: sqlite3.Connection) -> Iterator[None]:
    """Close a connection if the block raises an exception; otherwise it stays open."""
    try:
        yield
    except BaseException:
        connection.close()
        raise


def require_numbers_within_limits(path: Path, connection: sqlite3.Connection) -> None:
    """Raise StoreError about the first number in the store that is outside its limits, if there is one."""
    first_damage = next(numbers_beyond_limits(connection), None)
    if first_damage is not None:
        raise StoreError(f"{path}: {first_damage}")


def numbers_beyond_limits(connection: sqlite3.Connection) -> Iterator[str]:
    """Yield a line for each number in the store that is outside its limits.

    If several rows of a table have such numbers, only the first of these rows is reported.
    """
    for table in TABLES:
        limits = {column.name: LIMITS[column.type] for column in table.columns if column.type in LIMITS}
        if not limits:
            continue
        outside = " OR ".join(f"{name} NOT BETWEEN {low} AND {high}" for name, (low, high) in limits.items())
        query = f"SELECT {', '.join(table.names)} FROM {table.name} WHERE {outside} LIMIT 1"
        for cells in connection.execute(query):
            row = dict(zip(table.names, cells, strict=True))
            for name, (low, high) in limits.items():
                number = row[name]
                if number is not None and not low <= number <= high:
                    yield f"{key_text(table, row)} is damaged: its {name} is {number:g}, not {low:g} to {high:g}"


def connect_reading(path: Path, oldest: int = VERSION) -> sqlite3.Connection:
    """Return a connection to the store at ``path`` that cannot change rows.

    Raises StoreError if ``path`` is not a store, or if the store's version is before ``oldest`` or after this foldcar's.
    The tables of a store of an earlier version are not checked.
    """
    check_name(path)
    if not path.exists():
        raise StoreError(f"{path}: no such store{did_you_mean_file(path)}")
    if not path.is_file():
        raise StoreError(f"{path}: is not a file")
    with store_errors(path):
        # Not read-only, so that SQLite can merge changes that a killed writer left in files beside the store.
        connection = sqlite3.connect(f"{path.resolve().as_uri()}?mode=rw", timeout=BUSY_S, uri=True, isolation_level=None)
        with _closed_on_error(connection):
            connection.execute("PRAGMA query_only = ON")
            if _is_blank(path, connection, oldest):
                raise StoreError(f"{path}: is not a foldcar store")
        return connection


def beside(path: Path, suffix: str) -> Path:
    """Return the path of a file beside the store: the store's path, links resolved, with ``-wal`` or ``-lock``."""
    return Path(f"{os.path.realpath(path)}{suffix}")


def require_store(path: Path) -> None:
    """Raise StoreError if ``path`` is not a store of this version. Commands that must not create a store call it."""
    connect_reading(path).close()


def _is_blank(path: Path, connection: sqlite3.Connection, oldest: int = VERSION) -> bool:
    """Return True if the database has no tables yet, and False if it is a store of a version since ``oldest``.

    Raises StoreError if it is neither.
    """
    header = _read_header(path, connection)
    if header.table_count == 0 and header.application_id == 0:
        return True
    if header.application_id != APPLICATION_ID:
        raise StoreError(f"{path}: is not a foldcar store")
    _require_version(path, header.version, oldest)
    if header.version == VERSION:
        with store_errors(path):
            _check_schema(path, connection)
    return False


class _Header(NamedTuple):
    """What a database says of itself; a new database has 0 everywhere."""

    table_count: int
    application_id: int
    version: int


def _read_header(path: Path, connection: sqlite3.Connection) -> _Header:
    """Read the header of a database. Raises StoreError if the file is not a database, with advice if it is a listing."""
    try:
        with store_errors(path, "is not a foldcar store: "):
            (table_count,) = connection.execute("SELECT count(*) FROM sqlite_master").fetchone()
            (application_id,) = connection.execute("PRAGMA application_id").fetchone()
            (version,) = connection.execute("PRAGMA user_version").fetchone()
    except StoreError as error:
        is_other_file = isinstance(error.__cause__, sqlite3.DatabaseError) and "not a database" in str(error)
        if is_other_file:
            _raise_if_listing(path)
        raise
    return _Header(table_count, application_id, version)


def _require_version(path: Path, version: int, oldest: int) -> None:
    """Raise StoreError if a store's version is before ``oldest`` or after this foldcar's."""
    if oldest <= version <= VERSION:
        return
    remedy = "sweep into a new store"
    if OLDEST_TRIALS <= version < VERSION:
        remedy += "; `foldcar trials import NEW.db OLD.db` takes its trials along"
    raise StoreError(
        f"{path}: is a store of version {version}, and this foldcar reads version {VERSION}: {remedy}, or use the "
        "foldcar that made it"
    )


def _check_schema(path: Path, connection: sqlite3.Connection) -> None:
    """Raise StoreError if a table or view differs from foldcar's, or if there is a trigger."""
    stored_sql_by_name = dict(connection.execute("SELECT name, sql FROM sqlite_master WHERE type IN ('table', 'view')"))
    expected_sql_by_name = {table.name: table.sql for table in TABLES} | VIEWS
    for name, expected_sql in expected_sql_by_name.items():
        if name not in stored_sql_by_name:
            raise StoreError(f"{path}: is damaged: {name} is missing")
        if stored_sql_by_name[name] != expected_sql:
            raise StoreError(f"{path}: is damaged: {name} is changed")
    for (trigger,) in connection.execute("SELECT name FROM sqlite_master WHERE type = 'trigger'"):
        raise StoreError(f"{path}: has a trigger that foldcar does not make: {trigger}")


def _raise_if_listing(path: Path) -> None:
    """Raise StoreError, which advises `foldcar sweep`, if the file is a listing (a file that describes experiments).

    Do not call it for a store: closing a file drops the locks that SQLite holds on it in this process.
    """
    with contextlib.suppress(OSError), path.open("rb") as file:
        if b"vehicles" in file.read(MAX_LISTING_BYTES):
            sweep = f"foldcar sweep {path} --store {path.stem}.db"
            raise StoreError(f"{path}: is a listing, not a store; `{sweep}` simulates it into a store")


def check_name(store: Path) -> None:
    """Raise StoreError if SQLite would keep a store of this name in memory, where it would be lost."""
    if str(store) == ":memory:" or str(store).startswith("file:"):
        raise StoreError(f"{store}: SQLite does not treat this as a file name; use another, such as study.db")


def check_new(store: Path) -> None:
    """Raise StoreError if the file exists, or if its name cannot be that of a store."""
    check_name(store)
    if os.path.lexists(store):
        raise StoreError(f"{store}: already exists; name a new store")


@contextlib.contextmanager
def new_store(store: Path) -> Iterator[sqlite3.Connection]:
    """Yield a connection to a new store, which is renamed to ``store`` at the end of the block, or deleted on an error.

    Raises StoreError if the file exists, or if it cannot be written.
    """
    check_new(store)
    make_output_folder(store.parent)
    part = store.with_name(f".{store.name}.{os.getpid()}.part")
    try:
        with store_errors(store), contextlib.closing(sqlite3.connect(part, isolation_level=None)) as connection:
            # No journal file is needed, because an incomplete store is deleted.
            connection.execute("PRAGMA journal_mode = MEMORY")
            _create_schema(connection)
            with transaction(connection):
                yield connection
        part.rename(store)
    except OSError as error:
        raise StoreError(f"{error.filename or store}: cannot be written: {error.strerror or error}") from error
    finally:
        part.unlink(missing_ok=True)


def _create_schema(connection: sqlite3.Connection) -> None:
    """Create the tables of a store in an empty database, and mark it as a store of this version."""
    with transaction(connection):
        create_tables(connection)
        connection.execute(f"PRAGMA application_id = {APPLICATION_ID}")
        connection.execute(f"PRAGMA user_version = {VERSION}")


@contextlib.contextmanager
def writing(path: Path, synchronous: str = "NORMAL") -> Iterator[sqlite3.Connection]:
    """Yield a connection for writing to the store at ``path``, which is created, with its folder, if it is missing.

    What is committed is kept if the program is killed. If ``synchronous`` is "FULL", it is also kept in a power cut.
    Raises StoreError if the store is in use.
    """
    check_name(path)
    if path.is_dir():
        raise StoreError(f"{path}: is a folder, not a store")
    make_output_folder(path.parent)
    with _writer_lock(path):
        connection = _open_writing(path)
        status = path.stat()
        try:
            with store_errors(path):
                if _is_blank(path, connection):
                    _create_schema(connection)
                connection.execute(f"PRAGMA synchronous = {synchronous}")
            yield connection
        finally:
            _close_writing(path, connection, status)


@contextlib.contextmanager
def _writer_lock(path: Path) -> Iterator[None]:
    """Hold the lock of the store at ``path`` during the block, so that only this process writes to it.

    The lock is SQLite's lock of an empty database file beside the store. Raises StoreError if another process holds it.
    """
    file = beside(path, "-lock")
    try:
        file.touch()
        status = file.stat()
        # SQLite tries again for LOCK_S. If two processes begin at the same time, one of them gets the lock in this time.
        lock = sqlite3.connect(file, timeout=LOCK_S, isolation_level=None)
    except OSError as error:
        raise StoreError(f"{path}: cannot be written: {error.strerror or error}") from error
    with contextlib.closing(lock):
        _lock_database(path, lock)
        # A writer deletes the file when it ends, and the next one creates a new file. If this happened since the file
        # was opened, this process has locked a deleted file, which no other process sees.
        if not is_same_file(file, status):
            raise _in_use_error(path)
        try:
            yield
        finally:
            # Windows cannot delete an open file, so an empty one remains.
            with contextlib.suppress(OSError):
                file.unlink()


def _lock_database(path: Path, lock: sqlite3.Connection) -> None:
    """Lock the database ``lock``, which stands for the store at ``path``. Raises StoreError if it is locked."""
    try:
        # Nothing is written to this database, so it needs no journal file.
        lock.execute("PRAGMA journal_mode = MEMORY")
        lock.execute("BEGIN EXCLUSIVE")
    except sqlite3.Error as error:
        if "locked" in str(error):
            raise _in_use_error(path) from error
        raise StoreError(f"{path}: cannot be locked: {error}") from error


def _in_use_error(path: Path) -> StoreError:
    """Return the error that another process is writing a store."""
    return StoreError(f"{path}: another sweep or trial is writing this store; wait for it or use another store")


def is_same_file(path: Path, status: os.stat_result) -> bool:
    """Return whether ``path`` still names the file that had this ``status``: it was neither deleted nor replaced."""
    try:
        return os.path.samestat(path.stat(), status)
    except OSError:
        return False


def _open_writing(path: Path) -> sqlite3.Connection:
    """Return a connection for writing to a store.

    It uses SQLite's write-ahead mode, so that readers need not wait. This mode needs shared memory. Where the file system
    has none, the connection uses a rollback journal instead. Raises StoreError.
    """
    with store_errors(path):
        connection = sqlite3.connect(path, timeout=BUSY_S, isolation_level=None)
        with _closed_on_error(connection):
            # Other databases are refused before their mode is changed.
            _is_blank(path, connection)
            if _can_write_ahead(connection):
                return connection
        connection.close()
        connection = sqlite3.connect(path, timeout=BUSY_S, isolation_level=None)
        with _closed_on_error(connection):
            # Without shared memory, only a connection with exclusive access can leave write-ahead mode.
            connection.execute("PRAGMA locking_mode = EXCLUSIVE")
            connection.execute("PRAGMA journal_mode = DELETE")
            connection.execute("PRAGMA locking_mode = NORMAL")
            # The new locking mode applies from the next access on.
            connection.execute("SELECT count(*) FROM sqlite_master").fetchone()
        return connection


def _can_write_ahead(connection: sqlite3.Connection) -> bool:
    """Change a connection to SQLite's write-ahead mode, and return whether this mode works on the file system."""
    try:
        connection.execute("PRAGMA journal_mode = WAL")
        # If the mode does not work here, this first read fails.
        connection.execute("SELECT count(*) FROM sqlite_master").fetchone()
    except sqlite3.OperationalError as error:
        if "locked" in str(error):
            raise
        return False
    return True


def _close_writing(path: Path, connection: sqlite3.Connection, status: os.stat_result) -> None:
    """Close the connection and merge the write-ahead log, so that the store is one file if nobody else reads it.

    ``status`` is that of the file when it was opened.
    """
    # Close first: an interrupt may have left an unfinished query, which would prevent the change of mode.
    connection.close()
    # If the file was deleted or replaced, opening its name would create or change another file.
    if is_same_file(path, status):
        with contextlib.suppress(sqlite3.Error), contextlib.closing(sqlite3.connect(path)) as last:
            last.execute("PRAGMA journal_mode = DELETE")


@contextlib.contextmanager
def transaction(connection: sqlite3.Connection) -> Iterator[None]:
    """Commit the block's changes, or roll them back after an exception."""
    connection.execute("BEGIN IMMEDIATE")
    try:
        yield
        connection.execute("COMMIT")
    finally:
        # The transaction is open only after an error.
        if connection.in_transaction:
            with contextlib.suppress(sqlite3.Error):
                connection.execute("ROLLBACK")
