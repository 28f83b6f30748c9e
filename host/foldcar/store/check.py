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
from foldcar.store.tables import BUILD, BY_NAME, RECORDED, RUN, TABLES


@dataclass(slots=True)
class StoreCheck:
    """What a check of a store found: a line in ``findings`` for each damage; none if the store is intact.

    ``rows`` and ``logs`` are how many rows of all tables and how many logs of trials were checked.
    """

    rows: int
    logs: int
    findings: list[str]


def check_store(path: Path) -> StoreCheck:
    """Check a store's structure, references, numbers, JSON texts and logs.

    Raises StoreError if the store does not exist or cannot be read to its end.
    """
    with contextlib.closing(connect_reading(path)) as connection:
        try:
            findings = []
            for (line,) in connection.execute("PRAGMA integrity_check"):
                if line != "ok":
                    # SQLite's message may have several lines.
                    message = " ".join(str(line).split())
                    findings.append(f"SQLite's structure: {message}")
            row_count = 0
            for table in TABLES:
                (table_row_count,) = connection.execute(f"SELECT count(*) FROM {table.name}").fetchone()
                row_count += table_row_count
            findings += missing_references(connection)
            findings += numbers_beyond_limits(connection)
            findings += _damaged_texts(path, connection)
            log_count, log_findings = _check_logs(path, connection)
        except SQLITE_ERRORS as error:
            raise StoreError(f"{path}: cannot be read to its end: {error}") from error
    return StoreCheck(rows=row_count, logs=log_count, findings=findings + log_findings)


def _damaged_texts(path: Path, connection: sqlite3.Connection) -> Iterator[str]:
    """Yield a line for each table with a damaged row, which names the first such row.

    A row is damaged if a JSON text in it does not have the row's hash, or not the shape that foldcar writes.
    """
    for table in TABLES:
        try:
            # Reading a row checks it.
            for _ in read_rows(path, connection, table):
                pass
        except StoreError as error:
            yield str(error).removeprefix(f"{path}: ")


def require_references(path: Path, connection: sqlite3.Connection) -> None:
    """Raise StoreError if a row of the store at ``path`` refers to a missing row."""
    lines = missing_references(connection)
    if lines:
        raise StoreError(f"{path}: {lines[0]}")


def missing_references(connection: sqlite3.Connection) -> list[str]:
    """Return lines such as "table run: 2 rows refer to missing rows of body", in the order of the tables' names."""
    # The number of rows with a missing reference, by the names of their table and of the table that they refer to.
    row_counts: Counter[tuple[str, str]] = Counter()
    for table, _row_id, referred_table, _constraint in connection.execute("PRAGMA foreign_key_check"):
        row_counts[table, referred_table] += 1
    # SQLite does not check the reference of recorded values to their runs, because it is not declared as a foreign key.
    is_run_of_value = " AND ".join(f"{RUN.name}.{column} = {RECORDED.name}.{column}" for column in RUN.key)
    run_of_value = f"SELECT 1 FROM {RUN.name} WHERE {is_run_of_value}"
    (values_without_run,) = connection.execute(
        f"SELECT count(*) FROM {RECORDED.name} WHERE NOT EXISTS ({run_of_value})"
    ).fetchone()
    if values_without_run:
        row_counts[RECORDED.name, RUN.name] = values_without_run
    lines = []
    for (table, referred_table), row_count in sorted(row_counts.items()):
        verb = "refers" if row_count == 1 else "refer"
        lines.append(f"table {table}: {count(row_count, 'row')} {verb} to missing rows of {referred_table}")
    return lines


def damaged_logs(path: Path) -> list[str]:
    """Return a line for each log that is missing or changed, or whose trial is missing. Raises StoreError."""
    with contextlib.closing(connect_reading(path)) as connection, store_errors(path):
        return _check_logs(path, connection)[1]


def _check_logs(path: Path, connection: sqlite3.Connection) -> tuple[int, list[str]]:
    """Return how many logs of trials exist, and a line for each log that is missing or changed, or without a trial."""
    trials = connection.execute("SELECT id, log, log_sha256 FROM trial WHERE log IS NOT NULL ORDER BY id").fetchall()
    # A trial is stored before its log is begun, so every log should have a trial.
    logs_of_trials = {str(log) for _, log, _ in trials}
    findings = []
    for file in sorted(logs_folder(path).glob("trial-*.tlog")):
        if str(file.relative_to(store_folder(path))) not in logs_of_trials:
            findings.append(f"log {file}: its trial is missing")
    log_count = 0
    for trial_id, log, stored_sha256 in trials:
        try:
            file = log_file(path, str(log))
            sha256 = sha256_of(file)
        except StoreError as error:
            reason = str(error).removeprefix(f"{path}: ")
            findings.append(f"trial (id={trial_id}): {reason}")
            continue
        if sha256 is not None:
            log_count += 1
        # A trial whose session was killed has a log, but no hash of it.
        if stored_sha256 is None:
            continue
        if sha256 is None:
            findings.append(f"trial (id={trial_id}): its log {file} is missing")
        elif sha256 != stored_sha256:
            findings.append(f"trial (id={trial_id}): its log {file} does not match its SHA-256")
    return log_count, findings


def store_digest(store: Store) -> tuple[str, int]:
    """Return a digest of all runs in hexadecimal digits, and the number of runs. Raises StoreError.

    Stores with equal runs have equal digests, even if their rows have another order and other ids, and whatever listings
    and trials they contain. The digest is the sum, modulo 2^256, of the SHA-256 of every run as a JSON array: the build's
    name, the hashes of body, scene, settings and variation, the outcome, the metrics by name, the message, the recorded
    values.
    """
    identities = {column: _identities(store, column) for column in RUN.key}
    with_recorded = store.holds_recorded()
    digest_sum = run_count = 0
    for run in store.rows(RUN, f"ORDER BY {', '.join(RUN.order)}"):
        # In a damaged store, a row to which a run refers may be missing. Then the run's id takes its place.
        inputs = [identities[column].get(run[column], run[column]) for column in RUN.key]
        metrics = {name: run[name] for name in NUMBERS}
        recorded = []
        if with_recorded:
            for row in store.recorded_rows(run):
                recorded.append([row["name"], row["kind"], row["value"]])
        result = [run["outcome"], metrics, run["message"], recorded]
        text = json.dumps([inputs, result], sort_keys=True, separators=(",", ":"))
        run_digest = hashlib.sha256(text.encode()).digest()
        digest_sum += int.from_bytes(run_digest, "big")
        run_count += 1
    return f"{digest_sum % 2**256:064x}", run_count


def _identities(store: Store, key_column: str) -> dict[int, str]:
    """Return what identifies the rows to which a column of a run's key refers, by their ids, which differ in stores.

    It is the name of a build, and the hash of a body, a scene, settings or a variation.
    """
    table = BY_NAME[key_column.removesuffix("_id")]
    identity_column = "name" if table is BUILD else "hash"
    return {row["id"]: row[identity_column] for row in store.rows(table)}
