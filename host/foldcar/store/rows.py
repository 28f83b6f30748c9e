"""Reads and inserts rows of the store's tables as dictionaries by column."""

import hashlib
from collections.abc import Iterator, Mapping
from pathlib import Path
from sqlite3 import Connection
from typing import Any

from foldcar.shown_text import breaks_line, shown_line
from foldcar.store.errors import StoreError, store_errors
from foldcar.store.tables import Table

Row = dict[str, Any]

# By table, the columns of names that foldcar prints in sentences.
PRINTED = {"experiment": ("id", "vehicle", "environment")}
# Tables of JSON texts whose hash can be verified. The hash of a variation includes a text that is not stored.
HASHED = ("body", "settings", "scene")
SAMPLES_OF_SCENE = "SELECT fingerprint, sample FROM sample JOIN environment ON id = environment_id WHERE scene_id = ?"


def key_text(table: Table, row: Mapping[str, Any]) -> str:
    """Return a row's name in messages: ``run (build_id=1, body_id=7, …)``."""
    key = ", ".join(f"{column}={row.get(column)}" for column in table.key)
    return shown_line(f"{table.name} ({key})")


def insert_sql(table: Table, otherwise: str = "") -> str:
    """Return the SQL that inserts a row with all columns.

    ``otherwise`` says what happens if the key exists: ``OR IGNORE``, ``OR REPLACE``, or "" for an error.
    """
    placeholders = ", ".join("?" for _ in table.names)
    return f"INSERT {otherwise} INTO {table.name} VALUES ({placeholders})"


def read_rows(path: Path, connection: Connection, table: Table, rest: str = "", *values: Any) -> Iterator[Row]:
    """Yield rows of a table; ``rest`` is SQL from WHERE on. Raises StoreError if a row is damaged."""
    columns = ", ".join(table.names)
    with store_errors(path):
        for cells in connection.execute(f"SELECT {columns} FROM {table.name} {rest}", values):
            row = dict(zip(table.names, cells, strict=True))
            _check_row(path, connection, table, row)
            yield row


def read_row(path: Path, connection: Connection, table: Table, **key: Any) -> Row:
    """Return the row whose columns have the values of ``key``. Raises StoreError if it is missing."""
    has_key = " AND ".join(f"{column} = ?" for column in key)
    for row in read_rows(path, connection, table, f"WHERE {has_key}", *key.values()):
        return row
    shown_key = ", ".join(f"{column}={value}" for column, value in key.items())
    raise StoreError(f"{path}: {table.name} ({shown_key}) is missing")


def _check_row(path: Path, connection: Connection, table: Table, row: Row) -> None:
    """Raise StoreError if a text in the row is not as foldcar writes it.

    A row of a table of JSON texts must have the hash of its text. In other tables, each JSON text must have the shape
    that foldcar writes, and names must not have line breaks, because they are printed in sentences.
    """
    if table.name in HASHED:
        if not _has_hash(connection, table, row):
            raise StoreError(f"{path}: {key_text(table, row)} is damaged: its json does not match its hash")
        return
    damaged_column = _first_damaged_column(table, row)
    if damaged_column is not None:
        damage = f"foldcar does not write such a value of {damaged_column}"
        raise StoreError(f"{path}: {key_text(table, row)} is damaged: {damage}")


def _first_damaged_column(table: Table, row: Row) -> str | None:
    """Return the first column of a row in which a JSON text has another shape, or a name has line breaks, or None."""
    if not table.json_columns:
        return None
    # Imported here, because pydantic takes time to import.
    from foldcar.store.shapes import has_shape

    for column in table.json_columns:
        text = row[column]
        # Only an optional value is None: SQLite has checked that.
        if text is not None and not has_shape(table, column, text):
            return column
    for column in PRINTED.get(table.name, ()):
        if breaks_line(row[column]):
            return column
    return None


def _has_hash(connection: Connection, table: Table, row: Row) -> bool:
    """Return whether the hash in a row is the hash of its JSON text.

    A scene may have another hash: that of its text and of the sample that it belongs to. It has this hash if its Scenic
    program runs beside the simulation, because samples with equal texts may go differently then.
    """
    if row["hash"] == text_hash(row["json"]):
        return True
    if table.name != "scene":
        return False
    for fingerprint, sample in connection.execute(SAMPLES_OF_SCENE, (row["id"],)):
        if row["hash"] == text_hash(row["json"], scene_identity(fingerprint, sample)):
            return True
    return False


def text_hash(text: str, identity: str = "") -> str:
    """Return the hash of a JSON text and of ``identity``, which distinguishes it from equal texts."""
    return hashlib.sha256((text + identity).encode()).hexdigest()


def scene_identity(fingerprint: str, sample: int) -> str:
    """Return the identity of a sample's scene, a text that is different for each sample of each environment.

    If the Scenic program runs beside the simulation, samples with equal scenes may go differently. With this identity in
    their hashes, their scenes are stored separately.
    """
    return f"{fingerprint}/{sample}"
