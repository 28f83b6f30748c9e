"""Writing a store: who may, how long foldcar waits for other programs that lock it, transactions, rows and texts.

One process writes at a time: it holds SQLite's exclusive lock of a file beside the store, ``study.db-lock``, which the
system drops when the process ends, however it ends. Symbolic links lead to the same file. Readers are not kept out.
SQLite waits for locks too, but deaf to signals: each of its waits is short (BUSY_S), and what failed is tried again.
"""

import contextlib
import hashlib
import os
import sqlite3
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, TypeVar

from foldcar.interrupts import delayed, held, is_pending
from foldcar.store.errors import StoreError, store_errors
from foldcar.store.rows import Row, insert_sql, key_text, read_rows, stored
from foldcar.store.tables import BY_NAME, CHECKSUM, Table

# How long SQLite waits, and how long a command does, in seconds.
BUSY_S = 1.0
PATIENCE_S = 600.0

T = TypeVar("T")


@contextlib.contextmanager
def writer_lock(path: Path) -> Iterator[None]:
    """Hold the right to write the store at ``path``. StoreError if another process, or this one, has it."""
    file = Path(f"{os.path.realpath(path)}-lock")
    in_use = StoreError(f"{path}: another sweep or trial is writing this store; wait for it or use another store")
    try:
        file.touch()
        before = file.stat()
        # Longer than `is_written` looks at it.
        lock = sqlite3.connect(file, timeout=0.2, isolation_level=None)
    except OSError as error:
        raise StoreError(f"{path}: cannot be written: {error.strerror or error}") from error
    with contextlib.closing(lock):
        try:
            # Without a file for its journal, to which nothing is ever written.
            lock.execute("PRAGMA journal_mode = MEMORY")
            lock.execute("BEGIN EXCLUSIVE")
        except sqlite3.Error as error:
            raise in_use if "locked" in str(error) else StoreError(f"{path}: cannot be locked: {error}") from error
        # Who had it may have deleted the file meanwhile, and a third may have made another one.
        if not leads_to(file, before):
            raise in_use

        def delete() -> None:
            # Windows deletes no file that is open: an empty one stays.
            with contextlib.suppress(OSError):
                file.unlink()

        with held(delete):
            try:
                yield
            finally:
                delete()


def is_written(path: Path) -> bool | None:
    """Whether a process holds the right to write the store; None if one that held it was killed. Keeps nobody out."""
    file = Path(f"{os.path.realpath(path)}-lock")
    # Windows leaves an empty file of every writer.
    left = None if os.name == "posix" else False
    if not file.exists():
        return False
    try:
        with contextlib.closing(sqlite3.connect(f"{file.as_uri()}?mode=ro", 0, uri=True)) as lock:
            lock.execute("SELECT count(*) FROM sqlite_master").fetchone()
    except sqlite3.OperationalError as error:
        return "locked" in str(error)
    return left


def leads_to(path: Path, status: os.stat_result) -> bool:
    """Whether ``path`` still is the name of that file: it may have been deleted or replaced."""
    try:
        return os.path.samestat(path.stat(), status)
    except OSError:
        return False


@contextlib.contextmanager
def transaction(path: Path, connection: sqlite3.Connection) -> Iterator[None]:
    """Everything in the block, or nothing. Waits for other programs; ``path`` is what messages name."""
    patiently(path, lambda: connection.execute("BEGIN IMMEDIATE"))
    try:
        yield
        patiently(path, lambda: connection.execute("COMMIT"))
    finally:
        # Still open only if something went wrong: then nothing of it counts.
        if connection.in_transaction:
            with contextlib.suppress(sqlite3.Error):
                connection.execute("ROLLBACK")


def patiently(path: Path, attempt: Callable[[], T]) -> T:
    """What ``attempt`` gives, tried until no other program locks the store; standard error says that it waits.

    StoreError after PATIENCE_S, and at once if a signal waits to end the program.
    """
    begun = time.monotonic()
    told = False
    while True:
        try:
            return attempt()
        except sqlite3.OperationalError as error:
            # The error's code is known from Python 3.11 on.
            if "locked" not in str(error):
                raise
            if is_pending() or time.monotonic() - begun > PATIENCE_S:
                raise StoreError(f"{path}: is locked by another program; end that and try again") from error
        if not told:
            sys.stderr.write(f"{path}: waiting for another program that has it locked (Ctrl-C stops)\n")
            sys.stderr.flush()
            told = True


class StoreConnection:
    """What all writers of a store share. All methods raise StoreError."""

    def __init__(self, path: Path, connection: sqlite3.Connection) -> None:
        self.path = path
        self._connection = connection
        self._file = path.stat()

    def _put_text(self, table: str, text: str, identity: str = "") -> int:
        digest = hashlib.sha256((text + identity).encode()).hexdigest()
        return self._identify(table, "hash", digest, json=text)

    def _identify(self, table: str, column: str, value: str, **others: Any) -> int:
        """The id of the row with that value, which is made if there is none."""
        found = self._run(f"SELECT id FROM {table} WHERE {column} = ?", value).fetchone()
        return int(found[0]) if found else self._add(BY_NAME[table], {column: value, **others})

    def _add(self, table: Table, row: Mapping[str, Any]) -> int:
        """Add a row to a table whose rows are numbered; gives its number."""
        (last,) = self._run(f"SELECT max(id) FROM {table.name}").fetchone()
        number = int(last or 0) + 1
        self._insert(table, [{**row, "id": number}])
        return number

    def _insert(self, table: Table, rows: Iterable[Mapping[str, Any]], otherwise: str = "") -> None:
        """Add rows; ``otherwise`` says what happens to those whose key is there (:func:`rows.insert_sql`)."""
        with store_errors(self.path):
            self._connection.executemany(
                insert_sql(table, otherwise), (tuple(self._stored(table, row).values()) for row in rows)
            )

    def _update(self, table: Table, row: Row) -> None:
        """Write a row that was read and changed."""
        kept = self._stored(table, row)
        changes = ", ".join(f"{name} = :{name}" for name in (*table.names, CHECKSUM))
        where = " AND ".join(f"{name} = :{name}" for name in table.key)
        with store_errors(self.path):
            self._connection.execute(f"UPDATE {table.name} SET {changes} WHERE {where}", kept)

    def _rows(self, table: Table, rest: str = "", *values: Any) -> list[Row]:
        """Rows of a table; ``rest`` is SQL from WHERE on."""
        return list(read_rows(self.path, self._connection, table, rest, *values))

    def _row(self, table: Table, **key: Any) -> Row:
        """The row of that key; StoreError if it is gone."""
        found = self._rows(table, "WHERE " + " AND ".join(f"{name} = ?" for name in key), *key.values())
        if not found:
            raise StoreError(f"{self.path}: {key_text(table, key)} is missing")
        return found[0]

    def _stored(self, table: Table, row: Mapping[str, Any]) -> Row:
        try:
            return stored(table, row)
        except ValueError as error:
            raise StoreError(f"{self.path}: {table.name}: {error}") from None

    def _run(self, statement: str, *values: Any) -> Any:
        with store_errors(self.path):
            return self._connection.execute(statement, values)

    @contextlib.contextmanager
    def _transaction(self) -> Iterator[None]:
        with delayed(), store_errors(self.path), transaction(self.path, self._connection):
            yield
        if not leads_to(self.path, self._file):
            # SQLite goes on writing a file that has lost its name.
            raise StoreError(
                f"{self.path}: was deleted, moved or replaced while it was written: the last changes are not in it"
            )
