"""Makes a whole store of what is whole in a damaged one, and tells what is lost.

A row is kept if it matches its own checksum and what it refers to is kept too: a number that refers to a lost row could
come to mean another one. What is lost of a sweep the next sweep makes again. A trial is kept with its references emptied,
which its corrections say. The damaged store is only read.
"""

import contextlib
import shutil
import sqlite3
import tempfile
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

from foldcar.store.check import findings_of
from foldcar.store.connection import transaction
from foldcar.store.errors import SQLITE_ERRORS, StoreError
from foldcar.store.log_files import log_file, logs_folder, sha256_of
from foldcar.store.opening import beside, fill_blank, new_store
from foldcar.store.rows import Row, insert_sql, read_rows, stored
from foldcar.store.salvage import Rows, log_damage, salvage
from foldcar.store.tables import CORRECTION, DRAW, PATH, RECORDED, RUN, SAMPLE, TABLES, TRIAL, Column, Table
from foldcar.store.trial_writer import now_utc

BY = "foldcar repair"


@dataclass(slots=True)
class Repair:
    """What was saved, by table in rows, and what is lost.

    ``findings`` are what :mod:`foldcar.store.check` found damaged. ``missing`` rows are gaps between the numbers of those
    that are there; ``dependent`` ones are whole, but what they refer to is not. ``trials`` says which trials lost a
    reference, ``logs`` which logs no saved trial names.
    """

    saved: dict[str, int] = field(default_factory=dict)
    findings: list[str] = field(default_factory=list)
    missing: dict[str, int] = field(default_factory=dict)
    dependent: dict[str, int] = field(default_factory=dict)
    trials: list[str] = field(default_factory=list)
    logs: list[str] = field(default_factory=list)

    @property
    def is_whole(self) -> bool:
        """Whether nothing is known to be lost."""
        return not (self.findings or self.missing or self.dependent or self.trials or self.logs)


def repair_store(damaged: Path, whole: Path) -> Repair:
    """Write the store ``whole``, which must not exist, whole or not at all. StoreError."""
    if not damaged.is_file():
        raise StoreError(f"{damaged}: no such store")
    with new_store(whole) as (connection, logs), transaction(whole, connection):
        done = Repair()
        found = _found(damaged, done)
        if not any(found.values()):
            raise StoreError(f"{damaged}: no row of it is whole, or it is no foldcar store")
        for table in TABLES:
            _insert(connection, table, *(found[table.name][key] for key in sorted(found[table.name])))
            done.missing[table.name] = _missing(connection, table)
        for table in TABLES:
            if table is TRIAL:
                done.trials = _empty_lost_references(whole, connection)
            done.dependent[table.name] = _drop_dependent(connection, table)
            (done.saved[table.name],) = connection.execute(f"SELECT count(*) FROM {table.name}").fetchone()
        done.missing, done.dependent = (dict(+Counter(lost)) for lost in (done.missing, done.dependent))
        named = [log for (log,) in connection.execute("SELECT log FROM trial WHERE log IS NOT NULL ORDER BY id")]
        there = logs_folder(damaged).glob("trial-*.tlog")
        done.logs = sorted({str(file.relative_to(damaged.parent)) for file in there} - {*named})
        # They are named relative to the store's folder: in another folder it needs copies of its own.
        files = [(log_file(damaged, log), log_file(whole, log)) for log in named]
        logs += [(source, target, sha256_of(source)) for source, target in files if source.is_file()]
    return done


def _found(damaged: Path, done: Repair) -> Rows:
    """The whole rows of a store, read from a copy into which SQLite has put its journal or write-ahead log."""
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder).resolve() / "store"
        try:
            for suffix in ("", "-journal", "-wal"):
                if beside(damaged, suffix).is_file():
                    shutil.copyfile(beside(damaged, suffix), f"{copy}{suffix}")
            damage = log_damage(Path(f"{copy}-wal"))
            _restore_header(copy)
        except OSError as error:
            raise StoreError(f"{damaged}: cannot be read: {error.strerror}") from error
        with contextlib.suppress(*SQLITE_ERRORS), contextlib.closing(sqlite3.connect(copy)) as connection:
            # As it ends, it puts the log in.
            connection.execute("SELECT count(*) FROM sqlite_master").fetchone()
        with contextlib.closing(sqlite3.connect(copy)) as connection:
            done.findings = [*([f"write-ahead log: {damage}"] if damage else []), *findings_of(connection)]
            return salvage(copy, connection)


def _restore_header(copy: Path) -> None:
    """Write what the headers of all stores have in common, so that damage there does not keep SQLite from the log."""
    fresh = copy.with_name("fresh")
    with contextlib.closing(sqlite3.connect(fresh, isolation_level=None)) as connection:
        fill_blank(fresh, connection)
    header = bytearray(fresh.read_bytes()[:72])
    content = bytearray(copy.read_bytes())
    # How many pages there are and which are free, the version of the schema.
    header[24:44] = content[24:44]
    # The mode: with a log or without.
    header[18:20] = b"\2\2" if Path(f"{copy}-wal").exists() else b"\1\1"
    content[:72] = header
    copy.write_bytes(content)


def _insert(connection: sqlite3.Connection, table: Table, *rows: Row, otherwise: str = "") -> None:
    connection.executemany(insert_sql(table, otherwise), (tuple(stored(table, row).values()) for row in rows))


def _missing(connection: sqlite3.Connection, table: Table) -> int:
    """How many numbers below the highest are missing in a table whose rows are numbered, or of samples."""
    if table in (SAMPLE, DRAW):
        count = f"total(n) FROM (SELECT max(sample) + 1 - count(*) AS n FROM {table.name} GROUP BY {table.key[0]})"
    elif table.columns[0].type == "INTEGER" and table.columns[0].refers is None and table.key == ("id",):
        count = f"total(n) FROM (SELECT max(id) - count(*) AS n FROM {table.name})"
    else:
        return 0
    return int(connection.execute(f"SELECT {count}").fetchone()[0])


def _is_lost(column: Column) -> str:
    """The condition that what a row refers to in this column is not there."""
    return f"{column.name} NOT IN (SELECT id FROM {column.refers})"


def _empty_lost_references(whole: Path, connection: sqlite3.Connection) -> list[str]:
    """Empty what refers to lost rows in trials, with a correction for each; says of which trials."""
    told: dict[int, list[str]] = {}
    for column in (column for column in TRIAL.columns if column.refers):
        for trial in list(read_rows(whole, connection, TRIAL, f"WHERE {_is_lost(column)} ORDER BY id")):
            (last,) = connection.execute("SELECT coalesce(max(id), 0) FROM correction").fetchone()
            correction = {
                "id": last + 1,
                "trial_id": trial["id"],
                "corrected_utc": now_utc(),
                "field": column.name,
                "before": trial[column.name],
                "after": None,
                "reason": "what it refers to was lost",
                "operator": BY,
            }
            _insert(connection, CORRECTION, correction)
            _insert(connection, TRIAL, {**trial, column.name: None}, otherwise="OR REPLACE")
            told.setdefault(trial["id"], []).append(column.name.removesuffix("_id"))
    return [f"trial {number}: its {', '.join(names)} is lost" for number, names in sorted(told.items())]


def _drop_dependent(connection: sqlite3.Connection, table: Table) -> int:
    """Drop rows that refer to lost ones, and samples behind a missing one; how many they were."""
    lost = [_is_lost(column) for column in table.columns if column.refers]
    if table in (RECORDED, PATH):
        keys = ", ".join(RUN.key)
        lost.append(f"({keys}) NOT IN (SELECT {keys} FROM run)")
    dropped = connection.execute(f"DELETE FROM {table.name} WHERE {' OR '.join(lost) or 'FALSE'}").rowcount
    if table in (SAMPLE, DRAW):
        # Stored samples are those from 0 to n - 1.
        keys = ", ".join(table.key)
        place = f"row_number() OVER (PARTITION BY {table.key[0]} ORDER BY sample) - 1 AS place"
        behind = f"SELECT {keys} FROM (SELECT {keys}, {place} FROM {table.name}) WHERE place < sample"
        dropped += connection.execute(f"DELETE FROM {table.name} WHERE ({keys}) IN ({behind})").rowcount
    return dropped
