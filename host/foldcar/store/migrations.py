"""Brings stores of older versions up to this one.

The steps of each version change only what tables mean; then all rows are written anew into the tables of today, by the
names of their columns, checked and with checksums. All of it is one transaction: whatever dies leaves the old store.

| version | brought |
|---|---|
| 1 | runs of cars as designed |
| 2 | variations, programs beside the simulation, recorded values, failed runs |
| 3 | trials and corrections |
| 4 | checksums; a metric that is new gets its column without a new version |
| 5 | whether a trial's car was built or simulated, withdrawn trials, the view of trials |
| 6 | calibrations of the simulator |
| 7 | runs in the order in which sweeps make them; what an experiment's designs follow from |
"""

import contextlib
import hashlib
import json
import os
import shutil
import sqlite3
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from foldcar.store.car_in_log import car_in_log
from foldcar.store.errors import StoreError, store_errors
from foldcar.store.patience import patiently
from foldcar.store.rows import check_json, insert_sql, key_text, stored
from foldcar.store.tables import RESULT_VIEW, RUN, TABLES, VIEWS, Table
from foldcar.store.trial_records import BUILT

VERSION = 7


def create_tables(connection: sqlite3.Connection) -> None:
    """Make the tables and the views of this version."""
    for table in TABLES:
        connection.execute(table.sql)
    for view in VIEWS.values():
        connection.execute(view)


def migrate(path: Path, connection: sqlite3.Connection) -> None:
    """Bring an older store up to this version in one transaction; StoreError, and the old store, if that fails.

    ``path`` is what messages name.
    """
    with store_errors(path):
        (sound,) = connection.execute("PRAGMA integrity_check(1)").fetchone()
        if sound != "ok":
            raise StoreError(f"{path}: is damaged: {sound}; it is left at its version")
        # Views that a user made go on to name the tables that they name.
        connection.execute("PRAGMA legacy_alter_table = ON")
        with transaction(path, connection):
            (version,) = connection.execute("PRAGMA user_version").fetchone()
            if version < 2:
                _cars_are_as_designed(path, connection)
            if 3 <= version < 5:
                _logs_tell_the_car(path, connection)
            _rebuild(path, connection)
            connection.execute(f"PRAGMA user_version = {VERSION}")


def add_metrics(path: Path, connection: sqlite3.Connection) -> None:
    """Give a store of this version columns for metrics that are newer than it: empty ones, in one transaction."""
    with store_errors(path):
        there = {name for _, name, *_ in connection.execute("PRAGMA table_info(run)")}
        missing = [column for column in RUN.columns if column.name not in there]
        if missing:
            with transaction(path, connection):
                connection.execute("DROP VIEW IF EXISTS result")
                for column in missing:
                    connection.execute(f"ALTER TABLE run ADD COLUMN {column.sql}")
                connection.execute(RESULT_VIEW)


def copy_beside(path: Path, connection: sqlite3.Connection, version: int) -> Path:
    """Copy the store into a new file beside it, ``study.version3.db`` or ``study.version3-2.db`` and so on."""
    real = path.resolve() if path.is_symlink() else path
    part = real.with_name(f".{real.name}.{os.getpid()}.part")
    try:
        with contextlib.closing(sqlite3.connect(part, isolation_level=None)) as copy:
            connection.backup(copy)
            copy.execute("PRAGMA journal_mode = DELETE")
        shutil.copymode(real, part)
        with part.open("rb") as file:
            os.fsync(file.fileno())
        return _named(part, real, version)
    except (sqlite3.Error, OSError) as error:
        what = error.strerror if isinstance(error, OSError) else error
        raise StoreError(f"{path}: cannot be copied before its migration from version {version}: {what}") from error
    finally:
        for suffix in ("", "-journal", "-wal", "-shm"):
            part.with_name(part.name + suffix).unlink(missing_ok=True)


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


def _named(part: Path, store: Path, version: int) -> Path:
    """Give the finished copy the first name that is free."""
    number = 1
    while True:
        again = f"-{number}" if number > 1 else ""
        name = store.with_name(f"{store.stem}.version{version}{again}{store.suffix}")
        try:
            os.link(part, name)
        except FileExistsError:
            number += 1
            continue
        except OSError:
            # A file system without hard links.
            if name.exists():
                number += 1
                continue
            part.rename(name)
        return name


def _cars_are_as_designed(path: Path, connection: sqlite3.Connection) -> None:
    """Version 1 knows no variations: all cars get the one that changes nothing, of the spread of such cars."""
    nothing = hashlib.sha256(b"{}").hexdigest()
    for statement in (
        "CREATE TABLE variation (id INTEGER, hash TEXT, json TEXT)",
        f"INSERT INTO variation VALUES (1, '{nothing}', '{{}}')",
        "CREATE TABLE spread (id INTEGER, fingerprint TEXT)",
        "INSERT INTO spread VALUES (1, 'nominal')",
        "CREATE TABLE draw (spread_id INTEGER, sample INTEGER, variation_id INTEGER)",
        "INSERT INTO draw SELECT DISTINCT 1, sample, 1 FROM sample",
        "ALTER TABLE experiment ADD COLUMN spread_id INTEGER DEFAULT 1",
        "ALTER TABLE run ADD COLUMN variation_id INTEGER DEFAULT 1",
    ):
        connection.execute(statement)
    for name, text in connection.execute("SELECT id, facts FROM experiment").fetchall():
        try:
            facts = json.loads(text)
            facts |= {"condition": None, "variation": {}, "variation_seed": facts["seed"]}
        except (ValueError, KeyError, TypeError):
            message = f"{path}: experiment (id={name}): its facts are damaged; it is left at its version"
            raise StoreError(message) from None
        connection.execute("UPDATE experiment SET facts = ? WHERE id = ?", (json.dumps(facts), name))


def _logs_tell_the_car(path: Path, connection: sqlite3.Connection) -> None:
    """Up to version 4 a trial does not say what drove: its log does, and of an imported one its source vouched."""
    connection.execute("ALTER TABLE trial ADD COLUMN car TEXT")
    connection.execute("ALTER TABLE trial ADD COLUMN withdrawn INTEGER DEFAULT 0")
    for number, log, digest, source in connection.execute("SELECT id, log, log_sha256, source FROM trial").fetchall():
        car = BUILT if source is not None else car_in_log(path, log, digest) if log is not None else None
        connection.execute("UPDATE trial SET car = ? WHERE id = ?", (car, number))


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
    order = f" ORDER BY {', '.join(table.order)}" if table.order else ""
    for cells in connection.execute(f"SELECT {', '.join(names)} FROM old_{table.name}{order}"):
        old = dict(zip(names, cells, strict=True))
        try:
            row = stored(table, old)
            check_json(table, row)
        except ValueError as error:
            raise StoreError(f"{path}: {key_text(table, old)}: {error}; it is left at its version") from None
        yield tuple(row.values())
