"""One store of several: the rows of each under the numbers of the new one, every row once.

Input: stores of this version. Output: a new store, or nothing. Rows are equal by what they say, not by their numbers: a
body by its hash, a run by its key. A run that has other results in two stores means that a build is not what its name
says, and an experiment of which two stores say different things is two experiments: both are errors.
"""

import contextlib
import json
import sqlite3
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from foldcar.store.check import references
from foldcar.store.connection import transaction
from foldcar.store.designs import design_counts
from foldcar.store.errors import StoreError, store_errors
from foldcar.store.log_files import log_file, reference, referred_file, sha256_of
from foldcar.store.opening import check_new, connect_reading, new_store, refuse_damaged_log, require_version
from foldcar.store.rows import Row, insert_sql, read_rows, stored
from foldcar.store.tables import (
    BUILD,
    BY_NAME,
    CHECKSUM,
    CORRECTION,
    DESIGN,
    ENVIRONMENT,
    EXPERIMENT,
    MEDIA,
    PATH,
    RECORDED,
    RUN,
    STUDY,
    TABLES,
    TRIAL,
    Table,
)

LOG_NUMBERS = 10_000
DESIGN_COUNTS = "SELECT id, (SELECT count(*) FROM design WHERE experiment = e.id) FROM experiment e"
# The columns of a run's key, and which tables' rows their numbers are: `recorded` and `path` refer to runs by them.
REFERENCES = {column.name: column.refers for column in RUN.columns if column.refers}
# Among an experiment's facts, how many runs its sweep ended with before all was decided.
ENDED = "ended_runs"
SAME_COLUMNS = ("build_id", "environment_id", "spread_id", "vehicle", "environment")


def merge_stores(stores: Sequence[Path], merged: Path) -> dict[str, int]:
    """Make the store ``merged``, which must not exist; gives its number of rows by table. StoreError."""
    check_new(merged)
    for path in stores:
        with contextlib.closing(connect_reading(path)) as source:
            require_version(path, source)
    with new_store(merged) as (connection, logs), transaction(merged, connection):
        merge = _Merge(connection, merged, logs)
        for path in stores:
            with contextlib.closing(connect_reading(path)) as source, store_errors(path):
                refuse_damaged_log(path)
                source.execute("BEGIN")
                for lost in references(source):
                    raise StoreError(f"{path}: {lost}")
                merge.add(path, source)
        merge.end()
        return {
            table.name: connection.execute(f"SELECT count(*) FROM {table.name}").fetchone()[0] for table in TABLES
        }


class _Merge:
    """Adds stores to a new one, one after the other."""

    def __init__(
        self, connection: sqlite3.Connection, merged: Path, logs: list[tuple[Path, Path, str | None]]
    ) -> None:
        self._connection = connection
        self._merged = merged
        self._logs = logs
        self._stores: list[Path] = []
        # The store that is being added, and its rows' numbers in the new one.
        self._source = connection
        self._numbers: dict[str, dict[int, int]] = {}
        self._last = dict.fromkeys(BY_NAME, 0)
        # With how many runs the sweeps of each experiment ended.
        self._ended: dict[str, set[int | None]] = {}

    def add(self, path: Path, source: sqlite3.Connection) -> None:
        """Add all rows of a store. StoreError if one is damaged, or if they contradict those there."""
        self._stores.append(path)
        self._source = source
        self._numbers = {table.name: {} for table in TABLES}
        there = {tuple(row.values())[1:] for row in self._there(CORRECTION)}
        # The rows of the stores before: each trial among them is at most one of this store's.
        trials = self._there(TRIAL, "ORDER BY id DESC")
        designs = dict(self._connection.execute(DESIGN_COUNTS).fetchall())
        for table in TABLES:
            order = ("position",) if table is EXPERIMENT else table.order or table.key
            referring = ((one.name, one.refers or REFERENCES.get(one.name)) for one in table.columns)
            references = {name: referred for name, referred in referring if referred not in (None, EXPERIMENT.name)}
            for row in read_rows(path, source, table, f"ORDER BY {', '.join(order)}"):
                del row[CHECKSUM]
                before = tuple(map(row.get, RUN.key))
                for name, referred in references.items():
                    if row[name] is not None:
                        row[name] = self._numbers[referred][row[name]]
                if table is EXPERIMENT:
                    self._add_experiment(row)
                elif table is TRIAL:
                    self._add_trial(path, row, trials)
                elif table is MEDIA:
                    file = reference(self._merged, referred_file(path, row["file"]))
                    self._insert(MEDIA, {**row, "file": file}, "OR IGNORE")
                elif table is not CORRECTION:
                    self._add_row(table, row, before)
                elif tuple(row.values())[1:] not in there:
                    self._add_numbered(table, row)
        for name, count in source.execute(DESIGN_COUNTS):
            if designs.get(name, count) != count:
                self._differs(EXPERIMENT, {"id": name}, "designs", count, designs[name])

    def _add_row(self, table: Table, row: Row, before: tuple[Any, ...]) -> None:
        """A row that its number does not tell apart: if it is there already, it must be the same.

        ``before`` is a run's key in the store that is added.
        """
        number = row.get("id")
        if table.unique:
            row["id"] = self._last[table.name] + 1
        key = (table.unique,) if table.unique else table.key
        if self._insert(table, row, "OR IGNORE"):
            self._last[table.name] += 1
        else:
            (there,) = self._there(table, "WHERE " + " AND ".join(f"{name} = ?" for name in key), *map(row.get, key))
            if table is STUDY:
                # The facts of the first store, and the earliest time of creation.
                if row["key"] == "created_utc" and row["value"] < there["value"]:
                    self._insert(STUDY, row, "OR REPLACE")
                return
            if table is ENVIRONMENT and None in (row["dynamic"], there["dynamic"]):
                known = there["dynamic"] if row["dynamic"] is None else row["dynamic"]
                there["dynamic"] = row["dynamic"] = known
                self._insert(ENVIRONMENT, there, "OR REPLACE")
            row["id"] = there.get("id")
            self._compare(table, row, there)
            if table is RUN:
                self._compare_recorded(row, before)
        if number is not None:
            self._numbers[table.name][number] = row["id"]

    def _compare(self, table: Table, row: Row, there: Row) -> None:
        for name in table.names:
            if row[name] != there[name]:
                self._differs(table, row, name, row[name], there[name])

    def _compare_recorded(self, run: Row, before: tuple[Any, ...]) -> None:
        """StoreError if a run of both stores has a record in one of them only."""
        query = f"SELECT name FROM recorded WHERE {' AND '.join(f'{name} = ?' for name in RUN.key)}"
        new = {name for (name,) in self._source.execute(query, before)}
        old = {name for (name,) in self._connection.execute(query, tuple(map(run.get, RUN.key)))}
        if new != old:
            self._differs(RECORDED, run, "records", sorted(new), sorted(old))

    def _insert(self, table: Table, row: Row, otherwise: str = "") -> bool:
        """Whether the row was added; with ``OR IGNORE`` not if its key is there."""
        cells = tuple(stored(table, row).values())
        return self._connection.execute(insert_sql(table, otherwise), cells).rowcount > 0

    def _there(self, table: Table, rest: str = "", *values: Any) -> list[Row]:
        cells = self._connection.execute(f"SELECT {', '.join(table.names)} FROM {table.name} {rest}", values)
        return [dict(zip(table.names, row, strict=True)) for row in cells]

    def _add_numbered(self, table: Table, row: Row) -> None:
        self._last[table.name] += 1
        self._numbers[table.name][row["id"]] = self._last[table.name]
        self._insert(table, {**row, "id": self._last[table.name]})

    def _add_experiment(self, row: Row) -> None:
        """An experiment; one that differs in its number of environments, or in when its sweep ended, is the same."""
        facts = json.loads(row["facts"])
        self._ended.setdefault(row["id"], set()).add(facts.pop(ENDED, None))
        (row["position"],) = self._connection.execute("SELECT count(*) FROM experiment").fetchone()
        if self._insert(EXPERIMENT, row, "OR IGNORE"):
            return
        (there,) = self._there(EXPERIMENT, "WHERE id = ?", row["id"])
        known = json.loads(there["facts"])
        known.pop(ENDED, None)
        columns = {name: (row[name], there[name]) for name in SAME_COLUMNS}
        for name in sorted(facts.keys() | known.keys()):
            columns[name] = facts.get(name), known.get(name)
        for name, (value, before) in columns.items():
            if value != before:
                self._differs(EXPERIMENT, row, name, value, before)
        environments = max(row["environments"], there["environments"])
        self._insert(EXPERIMENT, {**there, "environments": environments}, "OR REPLACE")

    def _add_trial(self, path: Path, row: Row, trials: list[Row]) -> None:
        """A trial with its log, unless it is one of the ``trials`` of the stores before, told by what it says."""
        if row["log"] is not None:
            row["log"] = self._log(path, row["log"])
        same = next((one for one in reversed(trials) if all(one[name] == row[name] for name in TRIAL.names[1:])), None)
        if same is not None:
            trials.remove(same)
            self._numbers[TRIAL.name][row["id"]] = same["id"]
            return
        for there in trials:
            # The same drive, of which one store says something else.
            if row["log_sha256"] is not None and there["log_sha256"] == row["log_sha256"]:
                self._compare(TRIAL, {**row, "id": there["id"]}, there)
        self._add_numbered(TRIAL, row)

    def _log(self, path: Path, log: str) -> str:
        """The name of a trial's log in the new store's folder; its file is to be copied there if it is elsewhere."""
        source = log_file(path, log)
        digest = sha256_of(source)
        if digest is None:
            return log
        planned = {target: one for _, target, one in self._logs}
        for number in range(1, LOG_NUMBERS):
            name = Path(log) if number == 1 else Path(log).with_stem(f"{Path(log).stem}-{number}")
            target = log_file(self._merged, str(name))
            if planned.get(target, digest) == digest and (not target.exists() or sha256_of(target) == digest):
                self._logs.append((source, target, digest))
                return str(name)
        raise StoreError(f"{self._merged}: no name is left for log {log} of {path}")

    def end(self) -> None:
        """Say of an experiment that its sweep has ended only if one did with the runs that are there. StoreError."""
        for row in self._there(EXPERIMENT):
            facts = json.loads(row["facts"])
            runs = sum(design_counts(self._merged, self._connection, row["id"]).runs)
            if facts.pop(ENDED, None) != runs:
                facts |= {ENDED: runs} if runs in self._ended[row["id"]] else {}
                self._insert(EXPERIMENT, {**row, "facts": json.dumps(facts)}, "OR REPLACE")

    def _differs(self, table: Table, row: Row, name: str, value: Any, before: Any) -> None:
        """Raise the StoreError that says which store says what."""
        new, old = self._stores[-1], ", ".join(map(str, self._stores[:-1]))
        values = f"{name} is {self._told(name, value)} in {new}, {self._told(name, before)} in {old}"
        if table in (EXPERIMENT, DESIGN):
            experiment = row["id"] if table is EXPERIMENT else row["experiment"]
            place = "" if table is EXPERIMENT else f"design {row['position'] + 1}: "
            raise StoreError(f'experiment "{experiment}": {place}{values}: give one of them another name and sweep it')
        is_run = table in (RUN, RECORDED, PATH)
        key = ", ".join(f"{one} {self._told(one, row.get(one))}" for one in (RUN if is_run else table).key)
        why = ": the same build gave two results, so one of them is not that build" if is_run else ""
        raise StoreError(f"{'run' if is_run else table.name} ({key}): {values}{why}")

    def _told(self, column: str, value: Any) -> str:
        """A value for messages; instead of a row's number what tells it: a build's name, the beginning of a hash."""
        referred = BY_NAME.get(column.removesuffix("_id")) if column.endswith("_id") else None
        if value is not None and referred is not None and referred.unique:
            query = f"SELECT substr({referred.unique}, 1, ?) FROM {referred.name} WHERE id = ?"
            (value,) = self._connection.execute(query, (80 if referred is BUILD else 12, value)).fetchone()
        text = value if isinstance(value, str) else json.dumps(value)
        return text if len(text) <= 80 else f"{text[:77]}…"
