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

# Columns with names, by table.
PRINTED = {"experiment": ("id", "vehicle", "environment")}
# Tables of texts whose hash can be verified; of a variation, a part of the hashed text is not stored.
HASHED = ("body", "settings", "scene")
SAMPLES_OF_SCENE = "SELECT fingerprint, sample FROM sample JOIN environment ON id = environment_id WHERE scene_id = ?"


def key_text(table: Table, row: Mapping[str, Any]) -> str:
    """Return a row's name in messages: ``run (build_id=1, body_id=7, …)``."""
    return shown_line(f"{table.name} ({', '.join(f'{name}={row.get(name)}' for name in table.key)})")


def insert_sql(table: Table, otherwise: str = "") -> str:
    """Return the SQL that inserts a row with all columns.

    ``otherwise`` says what happens if the key exists: ``OR IGNORE``, ``OR REPLACE``, or "" for an error.
    """
    return f"INSERT {otherwise} INTO {table.name} VALUES ({', '.join('?' * len(table.names))})"


def read_rows(path: Path, connection: Connection, table: Table, rest: str = "", *values: Any) -> Iterator[Row]:
    """Yield rows of a table; ``rest`` is SQL from WHERE on. Raises StoreError if a row is damaged."""
    with store_errors(path):
        for cells in connection.execute(f"SELECT {', '.join(table.names)} FROM {table.name} {rest}", values):
            row = dict(zip(table.names, cells, strict=True))
            _check_row(path, connection, table, row)
            yield row


def read_row(path: Path, connection: Connection, table: Table, **key: Any) -> Row:
    """Return the row whose columns have the values of ``key``. Raises StoreError if it is missing."""
    where = " AND ".join(f"{name} = ?" for name in key)
    for row in read_rows(path, connection, table, f"WHERE {where}", *key.values()):
        return row
    raise StoreError(f"{path}: {table.name} ({', '.join(f'{name}={value}' for name, value in key.items())}) is missing")


def _check_row(path: Path, connection: Connection, table: Table, row: Row) -> None:
    """Raise StoreError if a JSON text of the row does not have its hash, or not the shape that foldcar writes."""
    damage = None
    if table.name in HASHED:
        if not _has_hash(connection, table, row):
            damage = "its json does not match its hash"
    elif table.json_columns:
        from foldcar.store.shapes import has_shape

        # A required value is never None: SQLite has checked that.
        present = [column for column in table.json_columns if row[column] is not None]
        damaged = [column for column in present if not has_shape(table, column, row[column])]
        # Names are printed in sentences, whose lines they must not break.
        damaged += [name for name in PRINTED.get(table.name, ()) if breaks_line(row[name])]
        damage = f"foldcar does not write such a value of {damaged[0]}" if damaged else None
    if damage is not None:
        raise StoreError(f"{path}: {key_text(table, row)} is damaged: {damage}")


def _has_hash(connection: Connection, table: Table, row: Row) -> bool:
    """Return whether a row's hash matches its JSON text, or for a scene its text and identity."""
    if row["hash"] == text_hash(row["json"]):
        return True
    samples = connection.execute(SAMPLES_OF_SCENE, (row["id"],)) if table.name == "scene" else ()
    return any(row["hash"] == text_hash(row["json"], scene_identity(*sample)) for sample in samples)


def text_hash(text: str, identity: str = "") -> str:
    """Return the hash of a JSON text and of ``identity``, which distinguishes it from equal texts."""
    return hashlib.sha256((text + identity).encode()).hexdigest()


def scene_identity(fingerprint: str, sample: int) -> str:
    """Return what distinguishes samples with equal scenes if the program runs beside the simulation."""
    return f"{fingerprint}/{sample}"
