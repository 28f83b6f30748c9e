"""Brings stores of older versions up to this one.

A step changes what the tables of its version mean; after all steps, all rows are written anew into the tables of today,
by the names of their columns, checked and with checksums. All of it is one transaction: whatever dies leaves the old
store. A late table or column needs no version: it is added empty.
"""

import contextlib
import itertools
import os
import sqlite3
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from foldcar.store.connection import transaction
from foldcar.store.errors import StoreError, store_errors
from foldcar.store.log_files import give_name
from foldcar.store.rows import check_json, insert_sql, key_text, stored
from foldcar.store.tables import TABLES, VIEWS, Table

VERSION = 1
# By version, what makes its rows those of the next.
STEPS: dict[int, Callable[[sqlite3.Connection], None]] = {}


def create_tables(connection: sqlite3.Connection) -> None:
    """Make the tables and the views of this version."""
    for statement in (*(table.sql for table in TABLES), *VIEWS.values()):
        connection.execute(statement)


def add_late(path: Path, connection: sqlite3.Connection) -> None:
    """Give a store of this version tables and columns that are newer than it: empty ones."""
    with store_errors(path):
        known = {name for (name,) in connection.execute("SELECT name FROM sqlite_master WHERE type = 'table'")}
        for table in TABLES:
            if table.late and table.name not in known:
                connection.execute(table.sql)
        missing = []
        for table in TABLES:
            there = {name for _, name, *_ in connection.execute(f"PRAGMA table_info({table.name})")}
            missing += [(table, column) for column in table.columns if column.late and column.name not in there]
        if missing:
            with transaction(path, connection):
                for name in VIEWS:
                    connection.execute(f"DROP VIEW IF EXISTS {name}")
                for table, column in missing:
                    connection.execute(f"ALTER TABLE {table.name} ADD COLUMN {column.sql}")
                for view in VIEWS.values():
                    connection.execute(view)


def migrate(path: Path, connection: sqlite3.Connection, version: int) -> None:
    """Bring a store of that older version up to this one; StoreError, and the old store, if that fails."""
    with store_errors(path):
        (sound,) = connection.execute("PRAGMA integrity_check(1)").fetchone()
        if sound != "ok":
            raise StoreError(f"{path}: is damaged: {sound}; it is left at its version")
        backup = _copy_beside(path, connection, version)
        try:
            # Views that a user made go on to name the tables that they name.
            connection.execute("PRAGMA legacy_alter_table = ON")
            with transaction(path, connection):
                for number in range(version, VERSION):
                    STEPS[number](connection)
                _rebuild(path, connection)
                connection.execute(f"PRAGMA user_version = {VERSION}")
        except BaseException:
            backup.unlink(missing_ok=True)
            raise
    sys.stderr.write(f"{path}: migrated from version {version} to {VERSION}; as it was: {backup}\n")


def _copy_beside(path: Path, connection: sqlite3.Connection, version: int) -> Path:
    """Copy the store into a new file beside it, ``study.version3.db`` or ``study.version3-2.db`` and so on."""
    real = Path(os.path.realpath(path)) if path.is_symlink() else path
    part = real.with_name(f".{real.name}.{os.getpid()}.part")
    try:
        connection.execute("VACUUM INTO ?", (str(part),))
        with part.open("rb+") as file:
            os.fsync(file.fileno())
        for number in itertools.count(1):
            name = real.with_name(f"{real.stem}.version{version}{f'-{number}' if number > 1 else ''}{real.suffix}")
            with contextlib.suppress(FileExistsError):
                give_name(part, name)
                return name
    except (sqlite3.Error, OSError) as error:
        what = error.strerror if isinstance(error, OSError) else error
        raise StoreError(f"{path}: cannot be copied before its migration from version {version}: {what}") from error
    finally:
        for suffix in ("", "-journal"):
            Path(f"{part}{suffix}").unlink(missing_ok=True)
    raise AssertionError


def _rebuild(path: Path, connection: sqlite3.Connection) -> None:
    """Move all rows into the tables of this version."""
    for view in VIEWS:
        connection.execute(f"DROP VIEW IF EXISTS {view}")
    there = {name for (name,) in connection.execute("SELECT name FROM sqlite_master WHERE type = 'table'")}
    old = [table for table in TABLES if table.name in there]
    for table in old:
        connection.execute(f"ALTER TABLE {table.name} RENAME TO old_{table.name}")
    create_tables(connection)
    for table in old:
        connection.executemany(insert_sql(table), _rows_of_old(path, connection, table))
        connection.execute(f"DROP TABLE old_{table.name}")


def _rows_of_old(path: Path, connection: sqlite3.Connection, table: Table) -> Iterator[tuple[Any, ...]]:
    there = [name for _, name, *_ in connection.execute(f"PRAGMA table_info(old_{table.name})")]
    names = [name for name in table.names if name in there]
    # In their new order, so that they are written one behind the other.
    order = ", ".join(table.order or table.key)
    for cells in connection.execute(f"SELECT {', '.join(names)} FROM old_{table.name} ORDER BY {order}"):
        old = dict(zip(names, cells, strict=True))
        try:
            row = stored(table, old)
            check_json(table, row)
        except ValueError as error:
            raise StoreError(f"{path}: {key_text(table, old)}: {error}; it is left at its version") from None
        yield tuple(row.values())
