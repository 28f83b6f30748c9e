"""A connection that writes to a store: finds, adds and changes rows, in transactions. The base of all writers.

Input: the path of a store and a connection that is open for writing (connection.py). Output: rows by column.
"""

import contextlib
import sqlite3
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from foldcar.store.connection import is_same_file, transaction
from foldcar.store.errors import StoreError, store_errors
from foldcar.store.rows import Row, insert_sql, read_row, read_rows, text_hash
from foldcar.store.tables import BY_NAME, Table


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
