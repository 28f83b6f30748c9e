"""Rows of the store's tables with their checksums: checked values in, rows that still are what was written out.

A checksum is the CRC-32 of the table's name and the row as a JSON object: its columns without the checksum itself and
without empty (NULL) ones, in alphabetical order, without spaces, in ASCII, numbers as Python's repr() writes them. So a
column that is added later, empty, changes none.
"""

import json
import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from json.encoder import encode_basestring_ascii
from pathlib import Path
from sqlite3 import Connection
from typing import Any

from foldcar.store.errors import StoreError, store_errors
from foldcar.store.tables import CHECKSUM, Table

Row = dict[str, Any]


def checksum(table: Table, row: Mapping[str, Any]) -> int:
    """The checksum of a row of that table; its column ``checksum``, if it has one, does not count."""
    cells = []
    # Runs are many: a JSON encoder takes twice as long for the same text.
    for head, name in table.checksum_order:
        value = row[name]
        if value is not None:
            cells.append(head + (encode_basestring_ascii(value) if value.__class__ is str else repr(value)))
    return zlib.crc32(f"{{{','.join(cells)}}}".encode(), table.checksum_start)


def stored(table: Table, row: Mapping[str, Any]) -> Row:
    """``row`` as the table keeps it, all columns in their order, the checksum last; absent ones are empty.

    ValueError, naming the column, if a value is none that the column takes.
    """
    kept: Row = {}
    for column in table.columns:
        name = column.name
        value = row.get(name)
        if value is None:
            if not column.null:
                raise ValueError(f"{name}: is empty")
        else:
            value = _TYPES[column.type](name, value)
            if column.choices and value not in column.choices:
                raise ValueError(f"{name}: {str(value)[:80]!r} is none of {', '.join(column.choices)}")
        kept[name] = value
    kept[CHECKSUM] = checksum(table, kept)
    return kept


def check_json(table: Table, row: Mapping[str, Any]) -> None:
    """ValueError, naming the column, if a text of a :func:`stored` row that should be JSON is none."""
    for column in table.columns:
        if column.type == "JSON":
            try:
                json.loads(row[column.name])
            except (ValueError, RecursionError) as error:
                raise ValueError(f"{column.name}: is no JSON: {error}") from None


def key_text(table: Table, row: Mapping[str, Any]) -> str:
    """Which row it is, for messages: ``run (build_id=1, body_id=7, …)``."""
    return f"{table.name} ({', '.join(f'{name}={row.get(name)}' for name in table.key)})"


def is_intact(table: Table, row: Row) -> bool:
    """Whether a row that was read, checksum included, is what was written."""
    return bool(checksum(table, row) == row[CHECKSUM])


def insert_sql(table: Table, otherwise: str = "") -> str:
    """INSERT of a row that :func:`stored` made; ``otherwise`` is ``OR IGNORE``, ``OR REPLACE`` or nothing."""
    names = (*table.names, CHECKSUM)
    return f"INSERT {otherwise} INTO {table.name} ({', '.join(names)}) VALUES ({', '.join('?' * len(names))})"


def columns_sql(connection: Connection, table: Table, alias: str = "", names: Sequence[str] = ()) -> str:
    """The table's columns, or those of ``names``, and its checksum, to be selected.

    NULL stands for metrics that the file does not have yet.
    """
    there = {name for _, name, *_ in connection.execute(f"PRAGMA table_info({table.name})")}
    prefix = f"{alias}." if alias else ""
    wanted = (*(names or table.names), CHECKSUM)
    return ", ".join(f"{prefix}{name}" if name in there else f"NULL AS {name}" for name in wanted)


def is_there(connection: Connection, table: Table) -> bool:
    """Whether the file has the table: it may be newer than the file."""
    found = connection.execute("SELECT 1 FROM sqlite_master WHERE type = 'table' AND name = ?", (table.name,))
    return found.fetchone() is not None


def read_rows(path: Path, connection: Connection, table: Table, rest: str = "", *values: Any) -> Iterator[Row]:
    """Rows of a table with their checksums, verified; ``rest`` is SQL from WHERE on. StoreError."""
    names = (*table.names, CHECKSUM)
    with store_errors(path):
        if table.late and not is_there(connection, table):
            return
        for cells in connection.execute(f"SELECT {columns_sql(connection, table)} FROM {table.name} {rest}", values):
            yield verified(path, table, dict(zip(names, cells, strict=True)))


def verified(path: Path, table: Table, row: Row) -> Row:
    """``row`` itself; StoreError, naming it, if it is not what was written."""
    if not is_intact(table, row):
        raise StoreError(
            f"{path}: {key_text(table, row)} is damaged: it does not match its checksum; "
            "`foldcar check` names all that is"
        )
    return row


def verify_cells(path: Path, table: Table, rows: Sequence[tuple[Any, ...]]) -> None:
    """StoreError if one of many ``rows`` is not what was written: cells in alphabetical order, checksum last.

    For rows by the million: three times as fast as :func:`verified`, which has the last word.
    """
    text, names = table.checksum_text, (*sorted(table.names), CHECKSUM)
    for cells in rows:
        if zlib.crc32((text % cells[:-1]).encode(errors="replace"), table.checksum_start) != cells[-1]:
            verified(path, table, dict(zip(names, cells, strict=True)))


def parsed(path: Path, table: Table, row: Row, column: str, kind: type | tuple[type, ...] = dict) -> Any:
    """The value of a JSON column, of that kind; StoreError, naming row and column, if it is none.

    A checksum vouches for what was written only: other programs may have written.
    """
    try:
        value = json.loads(row[column])
        if isinstance(value, kind):
            return value
    except (ValueError, TypeError, RecursionError):
        pass
    raise StoreError(f"{path}: {key_text(table, row)} is damaged: its {column} is not what foldcar writes")


def _integer(name: str, value: Any) -> int:
    if isinstance(value, int) and -(2**63) <= value < 2**63:
        return int(value)
    raise ValueError(f"{name}: {str(value)[:80]!r} is no whole number of 64 bits")


def _real(name: str, value: Any) -> float:
    # A number that is not equal to itself is none (NaN).
    if isinstance(value, (int, float)) and value == value:
        # SQLite keeps no negative zero in columns of this type.
        return float(value) + 0.0
    raise ValueError(f"{name}: {str(value)[:80]!r} is no number")


def _text(name: str, value: Any) -> str:
    if not isinstance(value, str):
        raise ValueError(f"{name}: {str(value)[:80]!r} is no text")
    try:
        value.encode()
    except UnicodeEncodeError:
        raise ValueError(f"{name}: {ascii(value)[:80]} holds what is no character") from None
    return value


def _anything(name: str, value: Any) -> str | float:
    return _text(name, value) if isinstance(value, str) else _real(name, value)


_TYPES: dict[str, Callable[[str, Any], Any]] = {
    "INTEGER": _integer,
    "REAL": _real,
    "TEXT": _text,
    "JSON": _text,
    "VALUE": _anything,
}
