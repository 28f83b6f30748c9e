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
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from itertools import groupby
from pathlib import Path
from typing import Any

from foldcar.store.check import findings_of
from foldcar.store.connection import transaction
from foldcar.store.errors import SQLITE_ERRORS, StoreError
from foldcar.store.log_files import log_file, logs_folder, sha256_of
from foldcar.store.opening import beside, fill_blank, new_store
from foldcar.store.rows import Row, insert_sql, stored
from foldcar.store.salvage import Rows, log_damage, salvage
from foldcar.store.tables import BY_NAME, CORRECTION, PATH, RECORDED, RUN, TABLES, TRIAL, Table
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
        done.missing = _gaps(found)
        dependent: Counter[str] = Counter()
        kept: Rows = {}
        for table in TABLES:
            rows = kept[table.name] = {}
            for key, row in sorted(found[table.name].items()):
                lost = _lost_references(table, row, kept)
                if lost and table is TRIAL:
                    row = _emptied(row, lost, found, done)
                elif lost:
                    dependent[table.name] += 1
                    continue
                rows[key] = row
            if table.name in ("sample", "draw"):
                dependent[table.name] += _drop_behind_gaps(rows)
            written = [tuple(stored(table, row).values()) for row in rows.values()]
            connection.executemany(insert_sql(table), written)
            done.saved[table.name] = len(written)
        done.dependent = dict(+dependent)
        done.logs = _unnamed_logs(damaged, kept[TRIAL.name])
        logs += _logs(damaged, whole, kept[TRIAL.name])
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


def _lost_references(table: Table, row: Row, kept: Mapping[str, Mapping[tuple[Any, ...], Row]]) -> list[str]:
    """The columns of a row that refer to rows that are not kept."""
    if table in (RECORDED, PATH) and tuple(row[name] for name in RUN.key) not in kept[RUN.name]:
        return list(RUN.key)
    return [
        column.name
        for column in table.columns
        if column.refers and row[column.name] is not None and (row[column.name],) not in kept[column.refers]
    ]


def _emptied(trial: Row, lost: list[str], found: Rows, done: Repair) -> Row:
    """A trial without references to lost rows, with a correction that says so of each."""
    corrections = found[CORRECTION.name]
    for column in lost:
        number = max((key[0] for key in corrections), default=0) + 1
        correction = {
            "id": number,
            "trial_id": trial["id"],
            "corrected_utc": now_utc(),
            "field": column,
            "before": trial[column],
            "after": None,
            "reason": "what it refers to was lost",
            "operator": BY,
        }
        corrections[number,] = stored(CORRECTION, correction)
    done.trials.append(f"trial {trial['id']}: its {', '.join(name.removesuffix('_id') for name in lost)} is lost")
    return {**trial, **dict.fromkeys(lost)}


def _gaps(found: Rows) -> dict[str, int]:
    """How many numbers below the highest are missing in tables whose rows are numbered."""
    gaps = {}
    for name, rows in found.items():
        number = BY_NAME[name].columns[0]
        if number.type == "INTEGER" and number.refers is None and BY_NAME[name].key == ("id",) and rows:
            gaps[name] = max(key[0] for key in rows) - len(rows)
        elif name in ("sample", "draw"):
            groups = groupby(sorted(rows), lambda key: key[0])
            gaps[name] = sum(keys[-1][1] + 1 - len(keys) for keys in (list(group) for _, group in groups))
    return {name: count for name, count in gaps.items() if count > 0}


def _drop_behind_gaps(rows: dict[tuple[Any, ...], Row]) -> int:
    """Stored samples are those from 0 to n - 1: drop those behind a missing one; how many they were."""
    expected: dict[Any, int] = {}
    dropped = []
    for key in sorted(rows):
        if key[1] == expected.get(key[0], 0):
            expected[key[0]] = key[1] + 1
        else:
            dropped.append(key)
    for key in dropped:
        del rows[key]
    return len(dropped)


def _unnamed_logs(damaged: Path, trials: Mapping[tuple[Any, ...], Row]) -> list[str]:
    """Logs beside the damaged store that no saved trial names: of trials that are lost."""
    named = {row["log"] for row in trials.values()}
    logs = (str(file.relative_to(damaged.parent)) for file in logs_folder(damaged).glob("trial-*.tlog"))
    return sorted(log for log in logs if log not in named)


def _logs(damaged: Path, whole: Path, trials: Mapping[tuple[Any, ...], Row]) -> Iterator[tuple[Path, Path, str | None]]:
    """Logs are named relative to the store's folder: in another folder it needs copies of its own."""
    for row in trials.values():
        if row["log"] is not None and (source := log_file(damaged, row["log"])).is_file():
            yield source, log_file(whole, row["log"]), sha256_of(source)
