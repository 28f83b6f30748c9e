"""A store opened to be written: transactions, rows with their checksums, texts kept once under their hash.

Sweeps (writer.py) and trials (trial_writer) write through it, one process at a time. What is read is verified.
"""

import contextlib
import hashlib
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from sqlite3 import Connection
from typing import Any

from foldcar.interrupts import delayed
from foldcar.store.errors import StoreError, store_errors
from foldcar.store.locks import leads_to, transaction
from foldcar.store.rows import Row, insert_sql, key_text, read_rows, stored
from foldcar.store.tables import BY_NAME, CHECKSUM, Table


class StoreConnection:
    """What all writers of a store share. All methods raise StoreError."""

    def __init__(self, path: Path, connection: Connection) -> None:
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
