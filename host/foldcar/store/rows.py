"""Reads and inserts rows of the store's tables as dictionaries by column."""

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from sqlite3 import Connection
from typing import Any

from foldcar.store.errors import StoreError, store_errors
from foldcar.store.tables import Table

Row = dict[str, Any]


def key_text(table: Table, row: Mapping[str, Any]) -> str:
    """Which row it is, for messages: ``run (build_id=1, body_id=7, …)``."""
    return f"{table.name} ({', '.join(f'{name}={row.get(name)}' for name in table.key)})"


def insert_sql(table: Table, otherwise: str = "") -> str:
    """INSERT of a row with all columns in their order; ``otherwise`` is ``OR IGNORE``, ``OR REPLACE`` or nothing."""
    return f"INSERT {otherwise} INTO {table.name} VALUES ({', '.join('?' * len(table.names))})"


def read_rows(path: Path, connection: Connection, table: Table, rest: str = "", *values: Any) -> Iterator[Row]:
    """Rows of a table; ``rest`` is SQL from WHERE on. StoreError."""
    with store_errors(path):
        for cells in connection.execute(f"SELECT {', '.join(table.names)} FROM {table.name} {rest}", values):
            yield dict(zip(table.names, cells, strict=True))


def parsed(path: Path, table: Table, row: Row, column: str, kind: type | tuple[type, ...] = dict) -> Any:
    """The value of a JSON column, of that kind; StoreError, naming row and column, if another program changed it."""
    try:
        value = json.loads(row[column])
        if isinstance(value, kind):
            return value
    except (ValueError, TypeError, RecursionError):
        pass
    raise StoreError(f"{path}: {key_text(table, row)} is damaged: its {column} is not what foldcar writes")
