"""A snapshot of a store, which does not see later changes by other programs.

Input: the path of a store. Output: rows of its tables, as dictionaries by column.
"""

from collections.abc import Callable, Iterator
from pathlib import Path
from sqlite3 import Connection
from typing import Any, TypeVar

from typing_extensions import Self

from foldcar.store.connection import open_reading
from foldcar.store.errors import store_errors
from foldcar.store.rows import Row, read_row, read_rows
from foldcar.store.tables import Table

T = TypeVar("T")


class Snapshot:
    """The tables of a store at the time at which it was opened. All methods raise StoreError."""

    def __init__(self, path: Path, connection: Connection) -> None:
        self.path = path
        self._connection = connection
        self._read_once: dict[Any, Any] = {}

    @classmethod
    def open(cls, path: Path) -> Self:
        """Open an existing store. Raises StoreError if there is no store of this version."""
        return cls(path, open_reading(path))

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._connection.close()

    def once(self, key: Any, read: Callable[[], T]) -> T:
        """Return the result of ``read``, cached under ``key``; an open store never changes."""
        if key not in self._read_once:
            self._read_once[key] = read()
        result: T = self._read_once[key]
        return result

    def rows(self, table: Table, rest: str = "", *values: Any) -> Iterator[Row]:
        """Yield rows of a table; ``rest`` is SQL from WHERE on."""
        return read_rows(self.path, self._connection, table, rest, *values)

    def row(self, table: Table, **key: Any) -> Row:
        """Return the row whose columns have the values of ``key``."""
        return read_row(self.path, self._connection, table, **key)

    def _rows(self, query: str, *values: Any) -> Iterator[Any]:
        """Yield the rows of an SQL query as tuples."""
        with store_errors(self.path):
            yield from self._connection.execute(query, values)
