"""A store opened to be written: transactions, and texts kept once under their hash.

Sweeps (writer.py) and trials (trial_writer) write through it, one process at a time.
"""

import contextlib
import hashlib
from collections.abc import Iterator
from pathlib import Path
from sqlite3 import Connection
from typing import Any

from foldcar.store.schema import StoreError, close_writing, open_writing, store_errors, writer_lock


class StoreConnection:
    """What all writers of a store share. All methods raise StoreError."""

    def __init__(self, path: Path, connection: Connection) -> None:
        self.path = path
        self._connection = connection

    def _put_text(self, table: str, text: str, identity: str = "") -> int:
        digest = hashlib.sha256((text + identity).encode()).hexdigest()
        self._run(f"INSERT OR IGNORE INTO {table} (hash, json) VALUES (?, ?)", digest, text)
        return self._id_of(table, "hash", digest)

    def _identify(self, table: str, column: str, value: str) -> int:
        self._run(f"INSERT OR IGNORE INTO {table} ({column}) VALUES (?)", value)
        return self._id_of(table, column, value)

    def _id_of(self, table: str, column: str, value: str) -> int:
        (row_id,) = self._run(f"SELECT id FROM {table} WHERE {column} = ?", value).fetchone()
        return int(row_id)

    def _run(self, statement: str, *values: Any) -> Any:
        with store_errors(self.path):
            return self._connection.execute(statement, values)

    @contextlib.contextmanager
    def _transaction(self) -> Iterator[None]:
        self._run("BEGIN IMMEDIATE")
        try:
            yield
            self._run("COMMIT")
        finally:
            # Still open only if something went wrong: then nothing of it counts.
            if self._connection.in_transaction:
                with contextlib.suppress(Exception):
                    self._connection.execute("ROLLBACK")


@contextlib.contextmanager
def writing(path: Path) -> Iterator[Connection]:
    """A connection to the store at ``path``; made, with its folder, if need be. StoreError if it is in use."""
    if path.is_dir():
        raise StoreError(f"{path}: is a folder, not a store")
    path.parent.mkdir(parents=True, exist_ok=True)
    with writer_lock(path):
        connection = open_writing(path)
        try:
            yield connection
        finally:
            close_writing(path, connection)
