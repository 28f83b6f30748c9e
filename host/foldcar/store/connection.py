"""Creates and opens a store's file, lets one process at a time write it, and refuses other files.

A store is one SQLite file. While it is written, it is in write-ahead mode with two files beside it (a rollback journal
where the file system has no shared memory), and the writer holds SQLite's exclusive lock of ``study.db-lock``, which
the system releases when the process ends, even if it is killed. When the writer closes, the store is a single file again.
Readers copy the store into a temporary database, which is deleted with the connection, so that writers need not wait.
"""

import contextlib
import os
import sqlite3
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from foldcar.outputs import make_output_folder
from foldcar.store.errors import StoreError, store_errors
from foldcar.store.rows import Row, insert_sql, key_text, read_row, read_rows, text_hash
from foldcar.store.tables import BY_NAME, LIMITS, OLDEST_TRIALS, TABLES, VERSION, VIEWS, Table, create_tables
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
    with contextlib.ExitStack() as stack:
        connection = stack.enter_context(contextlib.closing(connect_reading(path)))
        with store_errors(path):
            if path.stat().st_size > MAX_COPIED_BYTES:
                connection.execute("BEGIN")
                # There was no error, so the connection must not be closed at the end of the block.
                stack.pop_all()
                return connection
            copy = sqlite3.connect("", isolation_level=None)
            stack.callback(copy.close)
            connection.backup(copy)
            copy.execute("PRAGMA query_only = ON")
            # SQLite checks structure, types, required values and choices, so that later code can rely on them.
            (first_damage,) = copy.execute("PRAGMA quick_check(1)").fetchone()
            if first_damage != "ok":
                raise StoreError(f"{path}: is damaged: {first_damage}; `foldcar check {path}` lists all damage")
            for damaged_number in numbers_beyond_limits(copy):
                raise StoreError(f"{path}: {damaged_number}")
        # There was no error, so the copy must not be closed at the end of the block. The original is not needed any more.
        stack.pop_all()
        connection.close()
        return copy


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
    with store_errors(path), contextlib.ExitStack() as stack:
        # Not read-only, so that SQLite can merge changes that a killed writer left in files beside the store.
        connection = sqlite3.connect(f"{path.resolve().as_uri()}?mode=rw", timeout=BUSY_S, uri=True, isolation_level=None)
        stack.callback(connection.close)
        connection.execute("PRAGMA query_only = ON")
        if _is_blank(path, connection, oldest):
            raise StoreError(f"{path}: is not a foldcar store")
        # There was no error, so the connection must not be closed at the end of the block.
        stack.pop_all()
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
    try:
        with store_errors(path, "is not a foldcar store: "):
            (table_count,) = connection.execute("SELECT count(*) FROM sqlite_master").fetchone()
            (application_id,) = connection.execute("PRAGMA application_id").fetchone()
            (version,) = connection.execute("PRAGMA user_version").fetchone()
    except StoreError as error:
        if isinstance(error.__cause__, sqlite3.DatabaseError) and "not a database" in str(error):
            _raise_if_listing(path)
        raise
    if table_count == 0 and application_id == 0:
        return True
    if application_id != APPLICATION_ID:
        raise StoreError(f"{path}: is not a foldcar store")
    if not oldest <= version <= VERSION:
        remedy = "sweep into a new store"
        if OLDEST_TRIALS <= version < VERSION:
            remedy += "; `foldcar trials import NEW.db OLD.db` takes its trials along"
        raise StoreError(
            f"{path}: is a store of version {version}, and this foldcar reads version {VERSION}: {remedy}, or use the "
            "foldcar that made it"
        )
    if version == VERSION:
        with store_errors(path):
            _check_schema(path, connection)
    return False


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

    A commit survives the death of the program; with ``synchronous`` FULL also a power cut. Raises StoreError if the
    store is in use.
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

    The lock is that of a database file beside the store. Raises StoreError if another process holds it.
    """
    file = beside(path, "-lock")
    in_use_error = StoreError(f"{path}: another sweep or trial is writing this store; wait for it or use another store")
    try:
        file.touch()
        status = file.stat()
        # SQLite tries again for LOCK_S. If two processes begin at the same time, one of them gets the lock in this time.
        lock = sqlite3.connect(file, timeout=LOCK_S, isolation_level=None)
    except OSError as error:
        raise StoreError(f"{path}: cannot be written: {error.strerror or error}") from error
    with contextlib.closing(lock):
        try:
            # Nothing is written to this database, so it needs no journal file.
            lock.execute("PRAGMA journal_mode = MEMORY")
            lock.execute("BEGIN EXCLUSIVE")
        except sqlite3.Error as error:
            if "locked" in str(error):
                raise in_use_error from error
            raise StoreError(f"{path}: cannot be locked: {error}") from error
        # Meanwhile another process may have ended and deleted the lock's file, and a third one may have created a new
        # file of this name. Then this process has locked a file that nobody else sees.
        if not is_same_file(file, status):
            raise in_use_error
        try:
            yield
        finally:
            # Windows cannot delete an open file, so an empty one remains.
            with contextlib.suppress(OSError):
                file.unlink()


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
    with store_errors(path), contextlib.ExitStack() as stack:
        connection = sqlite3.connect(path, timeout=BUSY_S, isolation_level=None)
        # If an error occurs, close the connection. The lambda is evaluated then, because `connection` may be another one.
        stack.callback(lambda: connection.close())
        _is_blank(path, connection)
        try:
            connection.execute("PRAGMA journal_mode = WAL")
            # If the mode does not work here, this first read fails.
            connection.execute("SELECT count(*) FROM sqlite_master").fetchone()
        except sqlite3.OperationalError as error:
            if "locked" in str(error):
                raise
            connection.close()
            connection = sqlite3.connect(path, timeout=BUSY_S, isolation_level=None)
            # Without shared memory, only a connection with exclusive access can leave write-ahead mode.
            connection.execute("PRAGMA locking_mode = EXCLUSIVE")
            connection.execute("PRAGMA journal_mode = DELETE")
            connection.execute("PRAGMA locking_mode = NORMAL")
            connection.execute("SELECT count(*) FROM sqlite_master").fetchone()
        # There was no error, so the connection must not be closed at the end of the block.
        stack.pop_all()
        return connection


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


class StoreConnection:
    """The base class of all writers of a store. All methods raise StoreError."""

    def __init__(self, path: Path, connection: sqlite3.Connection) -> None:
        self.path = path
        self._connection = connection
        self._file = path.stat()

    def _put_text(self, table: str, text: str, identity: str = "") -> int:
        """Return the id of a JSON text in ``table``, to which it is added if it is missing.

        Equal texts with different ``identity`` are different rows.
        """
        return self._identify(table, "hash", text_hash(text, identity), json=text)

    def _identify(self, table: str, column: str, value: str, **others: Any) -> int:
        """Return the id of the row with this value in ``column``.

        If there is no such row, it is added; ``others`` are the values of its other columns.
        """
        row = self._run(f"SELECT id FROM {table} WHERE {column} = ?", value).fetchone()
        if row is not None:
            return int(row[0])
        return self._add(BY_NAME[table], {column: value, **others})

    def _add(self, table: Table, row: Mapping[str, Any]) -> int:
        """Add a row to a table whose rows have an ``id``, and return its id: the highest one + 1."""
        (last_id,) = self._run(f"SELECT max(id) FROM {table.name}").fetchone()
        row_id = int(last_id or 0) + 1
        self._insert(table, [{**row, "id": row_id}])
        return row_id

    def _insert(self, table: Table, rows: Iterable[Mapping[str, Any]], otherwise: str = "") -> None:
        """Add rows, in which columns that are not given are empty.

        ``otherwise`` says what happens if a row's key exists: ``OR IGNORE``, ``OR REPLACE``, or "" for an error.
        """
        cells_of_rows = ([row.get(column) for column in table.names] for row in rows)
        with store_errors(self.path):
            self._connection.executemany(insert_sql(table, otherwise), cells_of_rows)

    def _update(self, table: Table, row: Row) -> None:
        """Write back a row that was read and changed; its key must be unchanged."""
        changes = ", ".join(f"{name} = ?" for name in table.names)
        has_key = " AND ".join(f"{name} = ?" for name in table.key)
        values = [row.get(name) for name in (*table.names, *table.key)]
        self._run(f"UPDATE {table.name} SET {changes} WHERE {has_key}", *values)

    def rows(self, table: Table, rest: str = "", *values: Any) -> list[Row]:
        """Return rows of a table; ``rest`` is SQL from WHERE on."""
        return list(read_rows(self.path, self._connection, table, rest, *values))

    def row(self, table: Table, **key: Any) -> Row:
        """Return the row with that key. Raises StoreError if it is missing."""
        return read_row(self.path, self._connection, table, **key)

    def _run(self, statement: str, *values: Any) -> Any:
        """Execute an SQL statement; return SQLite's cursor over the result."""
        with store_errors(self.path):
            return self._connection.execute(statement, values)

    @contextlib.contextmanager
    def _transaction(self) -> Iterator[None]:
        """Commit the block's changes. Raises StoreError if the file was moved or deleted meanwhile."""
        with store_errors(self.path), transaction(self._connection):
            yield
        if not is_same_file(self.path, self._file):
            # SQLite continues to write to a file that was deleted or renamed.
            raise StoreError(
                f"{self.path}: was deleted, moved or replaced while it was written: the last changes are not in it"
            )
