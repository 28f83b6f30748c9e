"""Checks a store - SQLite's structures, references, logs of trials - or computes a digest of its runs.

Input: a store's path. Output: findings as lines. PRAGMA integrity_check also finds values of other types than the tables
declare.
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
from foldcar.statistics.words import count
from foldcar.store.connection import connect_reading, numbers_beyond_limits
from foldcar.store.errors import SQLITE_ERRORS, StoreError, store_errors
from foldcar.store.log_files import log_file, logs_folder, sha256_of, store_folder
from foldcar.store.reader import Store
from foldcar.store.rows import read_rows
from foldcar.store.tables import BY_NAME, RECORDED, RUN, TABLES


@dataclass(slots=True)
class StoreCheck:
    """The numbers of ``rows`` and ``logs`` that were checked, and a line in ``findings`` for each damage."""

    rows: int
    logs: int
    findings: list[str]


def check_store(path: Path) -> StoreCheck:
    """Check a store's structure, references, numbers, JSON texts and logs.

    Raises StoreError if the store does not exist or cannot be read to its end.
    """
    with contextlib.closing(connect_reading(path)) as connection:
        try:
            lines = [str(line) for (line,) in connection.execute("PRAGMA integrity_check") if line != "ok"]
            findings = [f"SQLite's structure: {' '.join(line.split())}" for line in lines]
            rows = sum(connection.execute(f"SELECT count(*) FROM {table.name}").fetchone()[0] for table in TABLES)
            findings += missing_references(connection)
            findings += numbers_beyond_limits(connection)
            findings += _damaged_texts(path, connection)
            logs, damaged = _check_logs(path, connection)
        except SQLITE_ERRORS as error:
            raise StoreError(f"{path}: cannot be read to its end: {error}") from error
    return StoreCheck(rows, logs, findings + damaged)


def _damaged_texts(path: Path, connection: sqlite3.Connection) -> Iterator[str]:
    """Yield a line for the first damaged row of each table: one whose JSON text has the wrong hash or shape."""
    for table in TABLES:
        try:
            for _ in read_rows(path, connection, table):
                pass
        except StoreError as error:
            yield str(error).removeprefix(f"{path}: ")


def missing_references(connection: sqlite3.Connection) -> list[str]:
    """Return a line for each pair of tables of which rows of the first refer to missing rows of the second."""
    where = " AND ".join(f"r.{name} = v.{name}" for name in RUN.key)
    # PRAGMA foreign_key_check returns (table, row, referred table, number of the constraint).
    missing = Counter((row[0], row[2]) for row in connection.execute("PRAGMA foreign_key_check"))
    # The reference of recorded values to runs is no foreign key.
    (missing[RECORDED.name, RUN.name],) = connection.execute(
        f"SELECT count(*) FROM {RECORDED.name} v WHERE NOT EXISTS (SELECT 1 FROM {RUN.name} r WHERE {where})"
    ).fetchone()
    # The plus leaves out pairs of tables without missing rows.
    return [
        f"table {name}: {count(number, 'row')} {'refers' if number == 1 else 'refer'} to missing rows of {referred}"
        for (name, referred), number in sorted((+missing).items())
    ]


def damaged_logs(path: Path) -> list[str]:
    """Return a line for each log of a store that is missing, damaged or without a trial. Raises StoreError."""
    with contextlib.closing(connect_reading(path)) as connection, store_errors(path):
        return _check_logs(path, connection)[1]


def _check_logs(path: Path, connection: sqlite3.Connection) -> tuple[int, list[str]]:
    """Return the number of logs, and a line for each log that is missing, damaged or without a trial."""
    trials = connection.execute("SELECT id, log, log_sha256 FROM trial WHERE log IS NOT NULL ORDER BY id").fetchall()
    # A trial is stored before its log is begun, so every log should have a trial.
    logs_of_trials = {str(log) for _, log, _ in trials}
    files, folder = sorted(logs_folder(path).glob("trial-*.tlog")), store_folder(path)
    findings = [
        f"log {file}: its trial is missing" for file in files if str(file.relative_to(folder)) not in logs_of_trials
    ]
    logs = 0
    for number, log, expected in trials:
        where = f"trial (id={number})"
        try:
            file = log_file(path, str(log))
            digest = sha256_of(file)
        except StoreError as error:
            findings.append(f"{where}: {str(error).removeprefix(f'{path}: ')}")
            continue
        logs += digest is not None
        if expected is not None and digest is None:
            findings.append(f"{where}: its log {file} is missing")
        elif expected is not None and digest != expected:
            findings.append(f"{where}: its log {file} does not match its SHA-256")
    return logs, findings


def store_digest(store: Store) -> tuple[str, int]:
    """Return a digest of all runs in hexadecimal digits, and the number of runs. Raises StoreError.

    Stores with equal runs have equal digests, whatever their order of rows, listings and trials. The digest is the sum,
    modulo 2^256, of the SHA-256 of every run as a JSON array: the build's name, the hashes of body, scene, settings and
    variation, the outcome, the metrics by name, the message, the recorded values.
    """
    # The build is identified by its name, body, scene, settings and variation by their hashes.
    names = {
        column: {row["id"]: row[name] for row in store.rows(BY_NAME[column.removesuffix("_id")])}
        for column, name in zip(RUN.key, ("name", "hash", "hash", "hash", "hash"), strict=True)
    }
    digest_sum = runs = 0
    with_recorded = store.holds_recorded()
    for row in store.rows(RUN, f"ORDER BY {', '.join(RUN.order)}"):
        key = [names[column].get(row[column], row[column]) for column in RUN.key]
        rows = store.recorded_rows(row) if with_recorded else ()
        recorded = [[record["name"], record["kind"], record["value"]] for record in rows]
        result = [row["outcome"], {name: row[name] for name in NUMBERS}, row["message"], recorded]
        text = json.dumps([key, result], sort_keys=True, separators=(",", ":"))
        digest_sum += int.from_bytes(hashlib.sha256(text.encode()).digest(), "big")
        runs += 1
    return f"{digest_sum % 2**256:064x}", runs
