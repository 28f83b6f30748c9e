"""Reads all of a store and names what is damaged, or gives a digest of its runs.

Damage is sought in SQLite's structures, rows, references, tables, logs of trials.

Input: a store's path. Output: findings as lines. A bit that flips anywhere in a row is found by the row's checksum;
in an index or in SQLite's own bookkeeping by PRAGMA integrity_check.
"""

import contextlib
import hashlib
import json
import sqlite3
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from foldcar.simulation.results import NUMBERS
from foldcar.store.errors import SQLITE_ERRORS, StoreError
from foldcar.store.log_files import log_file, logs_folder, sha256_of
from foldcar.store.migrations import VERSION
from foldcar.store.opening import beside, connect_reading, require_version
from foldcar.store.reader import Store
from foldcar.store.rows import columns_sql, is_intact, is_there, key_text
from foldcar.store.salvage import log_damage
from foldcar.store.tables import BY_NAME, CHECKSUM, PATH, RECORDED, RUN, TABLES, VIEWS, Table


@dataclass(slots=True)
class StoreCheck:
    """What was read, and what of it is damaged."""

    rows: int
    logs: int
    findings: list[str]


def check_store(path: Path) -> StoreCheck:
    """Read the whole store. StoreError if there is none, or if nothing of it can be read."""
    with contextlib.closing(connect_reading(path)) as connection:
        require_version(path, connection)
        done = StoreCheck(0, 0, [])
        damage = log_damage(beside(path, "-wal"))
        if damage is not None:
            done.findings.append(f"write-ahead log {path.name}-wal: {damage}")
        _read(connection, done)
        _check_logs(path, connection, done)
    return done


def findings_of(connection: sqlite3.Connection) -> list[str]:
    """What is damaged of a store, the logs of its trials aside."""
    return _read(connection, StoreCheck(0, 0, [])).findings


def _read(connection: sqlite3.Connection, done: StoreCheck) -> StoreCheck:
    try:
        lines = [str(line) for (line,) in connection.execute("PRAGMA integrity_check")]
    except SQLITE_ERRORS as error:
        lines = [str(error)]
    done.findings += [f"SQLite's structure: {' '.join(line.split())}" for line in lines if line != "ok"]
    # A text whose bytes are damaged must be read to be named.
    connection.text_factory = lambda content: content.decode("utf-8", "surrogateescape")
    done.findings += _schema(connection)
    for table in TABLES:
        done.findings += _damaged_rows(connection, table, done)
    done.findings += references(connection)
    return done


def _schema(connection: sqlite3.Connection) -> Iterator[str]:
    """Tables and views against their declarations; late ones may be missing in a store that is older than they."""
    try:
        texts = dict(connection.execute("SELECT name, sql FROM sqlite_master WHERE type IN ('table', 'view')"))
        there = {
            (table.name, name)
            for table in TABLES
            for _, name, *_ in connection.execute(f"PRAGMA table_info({table.name})")
        }
    except SQLITE_ERRORS as error:
        yield f"SQLite's schema: {error}"
        return
    grown = all((table.name, column.name) in there for table in TABLES for column in table.columns if column.late)
    for table in TABLES:
        if table.name not in texts and table.late:
            continue
        if table.name not in texts:
            yield f"table {table.name}: is missing"
        elif texts[table.name] != table.sql and not table.grows:
            yield f"table {table.name}: is not declared as in version {VERSION}"
    for name, view in VIEWS.items():
        if texts.get(name) != view and grown:
            yield f"view {name}: is not declared as in version {VERSION}"


def _damaged_rows(connection: sqlite3.Connection, table: Table, done: StoreCheck) -> Iterator[str]:
    names = (*table.names, CHECKSUM)
    try:
        if table.late and not is_there(connection, table):
            return
        for cells in connection.execute(f"SELECT {columns_sql(connection, table)} FROM {table.name} NOT INDEXED"):
            done.rows += 1
            row = dict(zip(names, cells, strict=True))
            if not is_intact(table, row):
                yield f"{key_text(table, row)}: does not match its checksum"
    except SQLITE_ERRORS as error:
        yield f"table {table.name}: cannot be read to its end: {error}"


def references(connection: sqlite3.Connection) -> Iterator[str]:
    """A line for each kind of rows that refer to what is not there."""
    where = " AND ".join(f"r.{name} = v.{name}" for name in RUN.key)
    try:
        missing = Counter((row[0], row[2]) for row in connection.execute("PRAGMA foreign_key_check"))
        for table in (RECORDED, PATH):
            (missing[table.name, RUN.name],) = connection.execute(
                f"SELECT count(*) FROM {table.name} v WHERE NOT EXISTS (SELECT 1 FROM {RUN.name} r WHERE {where})"
            ).fetchone()
    except SQLITE_ERRORS as error:
        yield f"references between tables: {error}"
        return
    for (name, referred), count in sorted((+missing).items()):
        yield f"table {name}: {count} rows refer to rows of {referred} that are not there"


def _check_logs(path: Path, connection: sqlite3.Connection, done: StoreCheck) -> None:
    try:
        trials = connection.execute("SELECT id, log, log_sha256 FROM trial WHERE log IS NOT NULL ORDER BY id").fetchall()
    except SQLITE_ERRORS:
        # Named with its table.
        return
    named = {str(log) for _, log, _ in trials}
    for there in sorted(logs_folder(path).glob("trial-*.tlog")):
        # A trial is stored before its log is begun.
        if str(there.relative_to(path.parent)) not in named:
            done.findings.append(f"log {there}: its trial is missing")
    for number, log, expected in trials:
        where = f"trial (id={number})"
        try:
            file = log_file(path, str(log))
            found = sha256_of(file)
        except StoreError as error:
            done.findings.append(f"{where}: {str(error).removeprefix(f'{path}: ')}")
            continue
        if found is not None:
            done.logs += 1
        if expected is not None and found is None:
            done.findings.append(f"{where}: its log {file} is missing")
        elif expected is not None and found != expected:
            done.findings.append(f"{where}: its log {file} does not match its SHA-256")


def store_digest(store: Store) -> tuple[str, int]:
    """A digest in hexadecimal digits, and how many runs it is of. StoreError.

    It is the same for the same keys with the same results, however they came about: the sum, modulo 2^256, of the SHA-256
    of every run as a JSON array: the build's name, the hashes of body, scene, settings and variation, the outcome, the
    metrics by name, the message, what was recorded. Neither the order of rows nor listings and trials count.
    """
    names = {
        column: {row["id"]: row[name] for row in store.rows(BY_NAME[column.removesuffix("_id")])}
        for column, name in zip(RUN.key, ("name", "hash", "hash", "hash", "hash"), strict=True)
    }
    total = runs = 0
    with_recorded = store.holds_recorded()
    for row in store.rows(RUN, f"ORDER BY {', '.join(RUN.order)}"):
        key = [names[column].get(row[column], row[column]) for column in RUN.key]
        rows = store.recorded_rows(row) if with_recorded else ()
        recorded = [[one["name"], one["kind"], one["value"]] for one in rows]
        result = [row["outcome"], {name: row[name] for name in NUMBERS}, row["message"], recorded]
        text = json.dumps([key, result], sort_keys=True, separators=(",", ":"))
        total += int.from_bytes(hashlib.sha256(text.encode()).digest(), "big")
        runs += 1
    return f"{total % 2**256:064x}", runs
