"""Merges several stores into a new one.

A body is identified by its hash, a run by its key, a trial by its UUID; their numbers change. Two different results of a
run are an error, because builds of one name must be equal. Two experiments of one name with different contents are an
error. If a trial was corrected after its store was copied, the corrected trial is kept.
"""

import contextlib
import json
import os
import shutil
import sqlite3
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from foldcar.store.check import missing_references
from foldcar.store.connection import check_new, connect_reading, new_store, numbers_beyond_limits
from foldcar.store.designs import design_counts
from foldcar.store.errors import StoreError, store_errors
from foldcar.store.log_files import log_file, reference, referred_file, sha256_of
from foldcar.store.rows import Row, insert_sql, read_rows
from foldcar.store.tables import (
    BUILD,
    BY_NAME,
    CORRECTION,
    DESIGN,
    ENVIRONMENT,
    EXPERIMENT,
    MEDIA,
    REALITY_RUN,
    RECORDED,
    RUN,
    SAMPLE,
    STUDY,
    TABLES,
    TRIAL,
    Table,
)
from foldcar.store.trial_records import RUNNING

DESIGN_COUNTS = "SELECT id, (SELECT count(*) FROM design WHERE experiment = e.id) FROM experiment e"
# The tables to which the columns of a run's key refer; `recorded` refers to runs by this key.
REFERENCES = {column.name: column.refers for column in RUN.columns if column.refers}
# The fact of an experiment that says how many runs its sweep had when it ended with undecided designs.
ENDED = "ended_runs"
# The facts on runs in other realities. Of two stores, the facts of the one with more of these runs planned are kept.
REALITY_FACTS = ("realities", "no_realities", "reality_spread")
# The columns in which two experiments of the same name must be equal.
SAME_COLUMNS = ("build_id", "environment_id", "spread_id", "vehicle", "environment")
# Whether a program is dynamic is known after its first run, parameters of objects only since version 5.
MAY_BE_UNKNOWN = {ENVIRONMENT.name: "dynamic", SAMPLE.name: "objects"}
# The columns that distinguish the corrections of a trial: all except the numbers of correction and trial.
CHANGE = CORRECTION.names[2:]


def merge_stores(stores: Sequence[Path], merged: Path) -> dict[str, int]:
    """Create the store ``merged``, which must not exist; return its number of rows by table. Raises StoreError."""
    check_new(merged)
    copied: list[Path] = []
    try:
        with new_store(merged) as connection:
            merge = Merge(connection, merged)
            for path in stores:
                with contextlib.closing(connect_reading(path)) as source, store_errors(path):
                    source.execute("BEGIN")
                    for missing in missing_references(source):
                        raise StoreError(f"{path}: {missing}")
                    merge.add(path, source)
            merge.end()
            for log, target in merge.logs.items():
                target.parent.mkdir(parents=True, exist_ok=True)
                copied.append(target)
                shutil.copyfile(log, target)
            return {
                table.name: connection.execute(f"SELECT count(*) FROM {table.name}").fetchone()[0] for table in TABLES
            }
    except BaseException:
        for target in copied:
            target.unlink(missing_ok=True)
        raise


# What a trial lacks that was imported from a table: what the table does not carry, and environment and program if the
# experiment was swept later. A store with the same trial may have it.
UNKNOWN_IF_IMPORTED = (
    "environment_id", "scenic_program", "body_id", "settings_id", "scene_id", "port", "log", "log_sha256",
)  # fmt: skip


class Merge:
    """Adds stores to the store ``merged``, one after another. ``logs`` maps the logs to copy to their new files."""

    def __init__(self, connection: sqlite3.Connection, merged: Path) -> None:
        self._connection = connection
        self._merged = merged
        # The logs to copy, with their targets.
        self.logs: dict[Path, Path] = {}
        self._stores: list[Path] = []
        # The store that is being added, and the new numbers of its rows by table and old number.
        self._source = connection
        self._numbers: dict[str, dict[int, int]] = {}
        # The last number that each table of the merged store has given.
        self._last = {table.name: self._last_number(table) for table in TABLES}
        # For each experiment, the numbers of runs with which its sweeps ended; None for a sweep that has not ended.
        self._ended: dict[str, set[int | None]] = {}

    def _last_number(self, table: Table) -> int:
        """Return the greatest number of a table's rows; 0 if they have no numbers."""
        if ("id", "INTEGER") not in [(column.name, column.type) for column in table.columns]:
            return 0
        return int(self._connection.execute(f"SELECT coalesce(max(id), 0) FROM {table.name}").fetchone()[0])

    def add(self, path: Path, source: sqlite3.Connection, tables: Sequence[Table] = TABLES) -> None:
        """Add all rows of a store, or of some of its tables. Raises StoreError if they contradict earlier stores."""
        # Readers refuse such a store, so they would refuse the merged one.
        for damage in numbers_beyond_limits(source):
            raise StoreError(f"{path}: {damage}")
        self._stores.append(path)
        self._source = source
        self._numbers = {table.name: {} for table in tables}
        designs = dict(self._connection.execute(DESIGN_COUNTS).fetchall())
        for table in tables:
            order = ("position",) if table is EXPERIMENT else table.order or table.key
            # Experiments are identified by name, which stays; all other references are numbers of rows, which change.
            referring = ((column.name, column.refers or REFERENCES.get(column.name)) for column in table.columns)
            references = {name: referred for name, referred in referring if referred not in (None, EXPERIMENT.name)}
            for row in read_rows(path, source, table, f"ORDER BY {', '.join(order)}"):
                # A run's key in the added store, before its numbers are replaced by those of the new store: its recorded
                # values are looked up by this key.
                source_key = tuple(map(row.get, RUN.key))
                for name, referred in references.items():
                    if row[name] is not None:
                        row[name] = self._numbers[referred][row[name]]
                if table is EXPERIMENT:
                    self._add_experiment(row)
                elif table is TRIAL:
                    self._add_trial(path, row)
                elif table is MEDIA:
                    file = reference(self._merged, referred_file(path, row["file"]))
                    self._insert(MEDIA, {**row, "file": file}, "OR IGNORE")
                elif table is not CORRECTION:
                    self._add_row(table, row, source_key)
                else:
                    # The numbers of corrections differ between stores.
                    existing = [{**correction, "id": row["id"]} for correction in self._corrections(row["trial_id"])]
                    if row not in existing:
                        self._add_numbered(CORRECTION, row)
        # A store with more or fewer designs of an experiment contradicts none of its single rows.
        for name, count in source.execute(DESIGN_COUNTS):
            if designs.get(name, count) != count:
                self._raise_difference(EXPERIMENT, {"id": name}, "designs", count, designs[name])

    def _add_row(self, table: Table, row: Row, source_key: tuple[Any, ...]) -> None:
        """Add a row that is not identified by its number; if it already exists, it must be equal.

        ``source_key`` is a run's key in the store that is being added.
        """
        number = row.get("id")
        # A table with a unique column, such as a hash, identifies its rows by that; numbers are those of the new store.
        if table.unique:
            row["id"] = self._last[table.name] + 1
        key = (table.unique,) if table.unique else table.key
        if self._insert(table, row, "OR IGNORE"):
            self._last[table.name] += 1
        else:
            where = " AND ".join(f"{name} = ?" for name in key)
            (existing,) = self._merged_rows(table, f"WHERE {where}", *map(row.get, key))
            if table is STUDY:
                # Keep the facts of the first store, and the earliest time of creation.
                if row["key"] == "created_utc" and row["value"] < existing["value"]:
                    self._insert(STUDY, row, "OR REPLACE")
                return
            # Of two stores, one may lack what the other knows.
            name = MAY_BE_UNKNOWN.get(table.name, "")
            if name and None in (row[name], existing[name]):
                existing[name] = row[name] = existing[name] if row[name] is None else row[name]
                self._insert(table, existing, "OR REPLACE")
            row["id"] = existing.get("id")
            self._compare(table, row, existing)
            if table is RUN:
                self._compare_recorded(row, source_key)
        if number is not None:
            self._numbers[table.name][number] = row["id"]

    def _compare(self, table: Table, row: Row, existing: Row) -> None:
        """Raise StoreError if a row differs from the merged store's row of the same key."""
        for name in table.names:
            if row[name] != existing[name]:
                self._raise_difference(table, row, name, row[name], existing[name])

    def _compare_recorded(self, run: Row, source_key: tuple[Any, ...]) -> None:
        """Raise StoreError if a run has recorded values of other names than the same run of the merged store."""
        query = f"SELECT name FROM recorded WHERE {' AND '.join(f'{name} = ?' for name in RUN.key)}"
        new = {name for (name,) in self._source.execute(query, source_key)}
        old = {name for (name,) in self._connection.execute(query, tuple(map(run.get, RUN.key)))}
        if new != old:
            self._raise_difference(RECORDED, run, "records", sorted(new), sorted(old))

    def _insert(self, table: Table, row: Row, otherwise: str = "") -> bool:
        """Insert a row; return whether it was added. With ``otherwise`` ``OR IGNORE``, a row whose key exists is not."""
        cells = [row.get(name) for name in table.names]
        return self._connection.execute(insert_sql(table, otherwise), cells).rowcount > 0

    def _merged_rows(self, table: Table, rest: str = "", *values: Any) -> list[Row]:
        """Return rows of the merged store; ``rest`` is SQL from WHERE on."""
        return list(read_rows(self._merged, self._connection, table, rest, *values))

    def _add_numbered(self, table: Table, row: Row) -> None:
        """Add a row under the table's next number."""
        self._last[table.name] += 1
        self._numbers[table.name][row["id"]] = self._last[table.name]
        self._insert(table, {**row, "id": self._last[table.name]})

    def _add_experiment(self, row: Row) -> None:
        """Add an experiment, or compare it with the merged one of its name.

        These may differ in the number of environments and in that of runs in other realities, of which the larger is
        kept, and in the end of their sweeps.
        """
        facts = json.loads(row["facts"])
        self._ended.setdefault(row["id"], set()).add(facts.pop(ENDED, None))
        (row["position"],) = self._connection.execute("SELECT count(*) FROM experiment").fetchone()
        if self._insert(EXPERIMENT, row, "OR IGNORE"):
            return
        (existing,) = self._merged_rows(EXPERIMENT, "WHERE id = ?", row["id"])
        existing_facts = json.loads(existing["facts"])
        existing_facts.pop(ENDED, None)
        reality_facts = max(
            ({name: side.pop(name) for name in REALITY_FACTS if name in side} for side in (existing_facts, facts)),
            key=lambda side: side.get("realities", 0),
        )
        columns = {name: (row[name], existing[name]) for name in SAME_COLUMNS}
        for name in sorted(facts.keys() | existing_facts.keys()):
            columns[name] = facts.get(name), existing_facts.get(name)
        for name, (value, before) in columns.items():
            if value != before:
                self._raise_difference(EXPERIMENT, row, name, value, before)
        environments = max(row["environments"], existing["environments"])
        kept_facts = json.dumps({**existing_facts, **reality_facts})
        self._insert(EXPERIMENT, {**existing, "environments": environments, "facts": kept_facts}, "OR REPLACE")

    def _add_trial(self, path: Path, row: Row) -> None:
        """Add a trial with its log. Of two copies with the same UUID, keep the one that was completed or corrected later.

        A copy is newer if the other one is still running, or has only a part of its corrections.
        """
        if row["log"] is not None:
            row["log"] = self._log(path, row)
        existing = next(iter(self._merged_rows(TRIAL, "WHERE uuid = ?", row["uuid"])), None)
        if existing is None:
            self._add_numbered(TRIAL, row)
            return
        self._numbers[TRIAL.name][row["id"]] = existing["id"]
        row = {**row, "id": existing["id"]}
        for name in UNKNOWN_IF_IMPORTED:
            row[name] = existing[name] = existing[name] if row[name] is None else row[name]
        # A table may write a number in another way, and shortens spaces.
        for name, meaning in (("design", json.loads), ("deviations", json.loads), ("note", str.split)):
            if meaning(row[name]) == meaning(existing[name]):
                row[name] = existing[name]
        of_trial = "WHERE trial_id = (SELECT id FROM trial WHERE uuid = ?)"
        source_corrections = read_rows(path, self._source, CORRECTION, of_trial, row["uuid"])
        new = [tuple(map(correction.get, CHANGE)) for correction in source_corrections]
        old = [tuple(map(correction.get, CHANGE)) for correction in self._corrections(existing["id"])]
        is_newer = existing["ending"] == RUNNING or (len(new) > len(old) and set(old) <= set(new))
        is_older = row["ending"] == RUNNING or (len(old) > len(new) and set(new) <= set(old))
        if not is_newer and not is_older:
            self._compare(TRIAL, row, existing)
        self._insert(TRIAL, row if is_newer else existing, "OR REPLACE")

    def _corrections(self, trial: int) -> list[Row]:
        """Return the merged store's corrections of a trial."""
        return self._merged_rows(CORRECTION, "WHERE trial_id = ?", trial)

    def _log(self, path: Path, trial: Row) -> str:
        """Return the name of a trial's log in the new store's folder, and plan to copy it there.

        If another log has that name, the trial's UUID is added to it. Raises StoreError if that name is taken, too.
        """
        source, name = log_file(path, trial["log"]), trial["log"]
        digest = sha256_of(source)
        if digest is None:
            # The log is missing, so there is nothing to copy.
            return str(name)
        logs_by_target = {target: log for log, target in self.logs.items()}
        for candidate in (Path(name), Path(name).with_stem(f"{Path(name).stem}-{trial['uuid'][:8]}")):
            target = log_file(self._merged, str(candidate))
            # Equal to the log that will be copied there, or to the file that is there now, or nothing is there.
            if sha256_of(logs_by_target.get(target, target)) in (None, digest):
                if not os.path.lexists(target):
                    self.logs[source] = target
                return str(candidate)
        raise StoreError(f"{target}: already exists with other contents; move it away first")

    def end(self) -> None:
        """Mark experiments' sweeps as ended, if one of the merged sweeps ended with as many runs. Raises StoreError."""
        for row in self._merged_rows(EXPERIMENT):
            facts = json.loads(row["facts"])
            runs = sum(design_counts(self._merged, self._connection, row["id"]).runs)
            # If both are equal, the row stays: it says correctly that the sweep has ended.
            if facts.pop(ENDED, None) != runs:
                facts |= {ENDED: runs} if runs in self._ended[row["id"]] else {}
                self._insert(EXPERIMENT, {**row, "facts": json.dumps(facts)}, "OR REPLACE")

    def _raise_difference(self, table: Table, row: Row, name: str, value: Any, before: Any) -> None:
        """Raise a StoreError: in ``row``, ``name`` is ``value`` in the added store, ``before`` in earlier stores."""
        new, old = self._stores[-1], ", ".join(map(str, self._stores[:-1])) or self._merged
        values = f"{name} is {self._shown(name, value)} in {new}, {self._shown(name, before)} in {old}"
        if table in (EXPERIMENT, DESIGN):
            experiment = row["id"] if table is EXPERIMENT else row["experiment"]
            place = "" if table is EXPERIMENT else f"design {row['position'] + 1}: "
            raise StoreError(
                f'experiment "{experiment}": {place}{values}: give one of them another name and sweep it again'
            )
        if table is TRIAL:
            # The trial's number in the added store.
            number = next(
                number for number, merged_number in self._numbers[TRIAL.name].items() if merged_number == row["id"]
            )
            raise StoreError(f"trial {number} of {new} ({row['uuid']}): {values}: correct one of them")
        is_run = table in (RUN, RECORDED, REALITY_RUN)
        shown_table = RUN if table is RECORDED else table
        key = ", ".join(f"{column} {self._shown(column, row.get(column))}" for column in shown_table.key)
        explanation = ": the same build gave two results, so one of them is not that build" if is_run else ""
        raise StoreError(f"{shown_table.name} ({key}): {values}{explanation}")

    def _shown(self, column: str, value: Any) -> str:
        """Return a value for messages; a row's number is replaced by a build's name or the beginning of a hash."""
        referred = BY_NAME.get(column.removesuffix("_id")) if column.endswith("_id") else None
        if value is not None and referred is not None and referred.unique:
            query = f"SELECT substr({referred.unique}, 1, ?) FROM {referred.name} WHERE id = ?"
            (value,) = self._connection.execute(query, (80 if referred is BUILD else 12, value)).fetchone()
        text = value if isinstance(value, str) else json.dumps(value)
        return text if len(text) <= 80 else f"{text[:77]}…"
