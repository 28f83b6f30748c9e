"""Merges several stores into a new one.

A body is identified by its hash, a run by its key, a trial by its UUID; their numbers change. Two different results of a
run are an error, because builds of one name must be equal. Two experiments of one name with different contents are an
error. If a trial was corrected after its store was copied, the corrected trial is kept.
"""

import contextlib
import json
import sqlite3
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, NoReturn

from foldcar.store.check import require_references
from foldcar.store.connection import check_new, connect_reading, new_store, require_numbers_within_limits
from foldcar.store.designs import design_counts
from foldcar.store.errors import StoreError, store_errors
from foldcar.store.log_copies import LogCopies
from foldcar.store.log_files import reference, referred_file
from foldcar.store.merge_words import key_with_values, shown_value
from foldcar.store.rows import Row, insert_sql, read_rows
from foldcar.store.tables import (
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
    """Create the store ``merged`` with the contents of several stores. Return its number of rows by table.

    The logs of the trials are copied beside it. Raises StoreError if ``merged`` exists, or if the stores contradict each
    other; then nothing is created.
    """
    check_new(merged)
    log_copies = LogCopies(merged)
    try:
        with new_store(merged) as connection:
            merge = Merge(connection, merged, log_copies)
            for path in stores:
                with contextlib.closing(connect_reading(path)) as source, store_errors(path):
                    source.execute("BEGIN")
                    require_references(path, source)
                    merge.add(path, source)
            merge.end()
            log_copies.make()
            row_counts = {}
            for table in TABLES:
                (row_counts[table.name],) = connection.execute(f"SELECT count(*) FROM {table.name}").fetchone()
            return row_counts
    except BaseException:
        log_copies.delete()
        raise


# What a trial lacks that was imported from a table: what the table does not carry, and environment and program if the
# experiment was swept later. A store with the same trial may have it.
UNKNOWN_IF_IMPORTED = (
    "environment_id", "scenic_program", "body_id", "settings_id", "scene_id", "port", "log", "log_sha256",
)  # fmt: skip


def _taken_reality_facts(facts: dict[str, Any]) -> dict[str, Any]:
    """Remove the facts on runs in other realities from an experiment's facts, and return them."""
    return {name: facts.pop(name) for name in REALITY_FACTS if name in facts}


def _changes(corrections: Iterable[Row]) -> set[tuple[Any, ...]]:
    """Return what corrections change; their own numbers and that of the trial differ between stores."""
    return {tuple(correction[name] for name in CHANGE) for correction in corrections}


def _share_values(row: Row, existing: Row) -> None:
    """Fill gaps in two copies of a trial, and make values equal that mean the same.

    One of the copies may have been imported from a table. Such a copy lacks some values, which it gets from the other
    one. And its texts may differ in form: a table may write a number in another way, and shortens spaces.
    """
    for name in UNKNOWN_IF_IMPORTED:
        if row[name] is None:
            row[name] = existing[name]
        existing[name] = row[name]
    for name in ("design", "deviations"):
        if json.loads(row[name]) == json.loads(existing[name]):
            row[name] = existing[name]
    if row["note"].split() == existing["note"].split():
        row["note"] = existing["note"]


class Merge:
    """Adds stores to the store ``merged``, one after another, and plans the copies of their logs."""

    def __init__(self, connection: sqlite3.Connection, merged: Path, log_copies: LogCopies) -> None:
        self._connection = connection
        self._merged = merged
        self._log_copies = log_copies
        self._added_stores: list[Path] = []
        # The store that is being added.
        self._source = connection
        # The rows of a store get new numbers in the merged store. These are kept for the store that is being added: by
        # table, and by the number that the row has in that store.
        self._new_numbers: dict[str, dict[int, int]] = {}
        # The highest number of a row in each table of the merged store.
        self._last_numbers = {table.name: self._last_number(table) for table in TABLES}
        # How many runs each experiment had in the stores in which its sweep has ended. A store in which the sweep has not
        # ended adds None.
        self._run_counts_at_end: dict[str, set[int | None]] = {}

    def _last_number(self, table: Table) -> int:
        """Return the greatest number of a table's rows; 0 if they have no numbers."""
        if ("id", "INTEGER") not in [(column.name, column.type) for column in table.columns]:
            return 0
        return int(self._connection.execute(f"SELECT coalesce(max(id), 0) FROM {table.name}").fetchone()[0])

    def add(self, path: Path, source: sqlite3.Connection, tables: Sequence[Table] = TABLES) -> None:
        """Add all rows of the store ``source`` at ``path``, or of some of its tables.

        A table must come after those to which it refers. Raises StoreError if the store contradicts the earlier ones.
        """
        # All commands refuse a store with impossible numbers, so they would refuse the merged store, too.
        require_numbers_within_limits(path, source)
        self._added_stores.append(path)
        self._source = source
        self._new_numbers = {table.name: {} for table in tables}
        earlier_design_counts = dict(self._connection.execute(DESIGN_COUNTS).fetchall())
        for table in tables:
            order = ("position",) if table is EXPERIMENT else table.order or table.key
            for row in read_rows(path, source, table, f"ORDER BY {', '.join(order)}"):
                self._add_source_row(path, table, row)
        # If two stores have the same experiment, their designs were compared above one by one. That one of them has
        # further designs shows only in their number.
        for experiment, design_count in source.execute(DESIGN_COUNTS):
            earlier_count = earlier_design_counts.get(experiment, design_count)
            if earlier_count != design_count:
                self._raise_difference(EXPERIMENT, {"id": experiment}, "designs", design_count, earlier_count)

    def _add_source_row(self, path: Path, table: Table, row: Row) -> None:
        """Add a row of the store at ``path`` to the merged store.

        If the row refers to other rows by their numbers, these are replaced by their numbers in the merged store.
        """
        original_row = dict(row)
        self._renumber(table, row)
        if table is EXPERIMENT:
            self._add_experiment(row)
        elif table is TRIAL:
            self._add_trial(path, row)
        elif table is CORRECTION:
            self._add_correction(row)
        elif table is MEDIA:
            file = reference(self._merged, referred_file(path, row["file"]))
            self._insert(MEDIA, {**row, "file": file}, "OR IGNORE")
        else:
            self._add_row(table, row, original_row)

    def _renumber(self, table: Table, row: Row) -> None:
        """Replace the numbers of other rows, to which a row refers, by their numbers in the merged store."""
        for column in table.columns:
            referred_table = column.refers or REFERENCES.get(column.name)
            # The column does not refer to another row, or refers to an experiment by its name, which stays.
            if referred_table is None or referred_table == EXPERIMENT.name:
                continue
            number = row[column.name]
            if number is not None:
                row[column.name] = self._new_numbers[referred_table][number]

    def _add_correction(self, row: Row) -> None:
        """Add a correction of a trial, unless the merged store has an equal one."""
        for existing in self._corrections(row["trial_id"]):
            # The numbers of corrections differ between stores.
            if {**existing, "id": row["id"]} == row:
                return
        self._add_numbered(CORRECTION, row)

    def _add_row(self, table: Table, row: Row, original_row: Row) -> None:
        """Add a row of a table whose rows are not identified by their numbers, but by their key or a unique column.

        If the merged store has the row already, both must be equal, or this raises StoreError. ``original_row`` is the
        row with the numbers that it has in the store that is being added.
        """
        # The rows of some tables have numbers and a unique column, such as a hash. A new row gets the next number.
        if table.unique:
            row["id"] = self._last_numbers[table.name] + 1
        is_new = self._insert(table, row, "OR IGNORE")
        if is_new:
            self._last_numbers[table.name] += 1
        elif table is STUDY:
            self._keep_earliest_creation(row)
        else:
            # The row gets the number of the existing row.
            self._unite(table, row)
            if table is RUN:
                self._compare_recorded(row, original_row)
        if "id" in original_row:
            self._new_numbers[table.name][original_row["id"]] = row["id"]

    def _keep_earliest_creation(self, row: Row) -> None:
        """Keep the facts of the first store, but the earliest time of creation."""
        (existing,) = self._merged_rows(STUDY, "WHERE key = ?", row["key"])
        if row["key"] == "created_utc" and row["value"] < existing["value"]:
            self._insert(STUDY, row, "OR REPLACE")

    def _unite(self, table: Table, row: Row) -> None:
        """Compare a row with the row of the merged store that has the same key. Raises StoreError if they differ.

        ``row`` gets the number of the existing row. In some tables, one column may be unknown in one of the two rows.
        Then both get the value of the other one.
        """
        key = (table.unique,) if table.unique else table.key
        has_key = " AND ".join(f"{name} = ?" for name in key)
        (existing,) = self._merged_rows(table, f"WHERE {has_key}", *(row[name] for name in key))
        optional_column = MAY_BE_UNKNOWN.get(table.name)
        if optional_column is not None:
            if row[optional_column] is None:
                row[optional_column] = existing[optional_column]
            elif existing[optional_column] is None:
                existing[optional_column] = row[optional_column]
                self._insert(table, existing, "OR REPLACE")
        row["id"] = existing.get("id")
        self._compare(table, row, existing)

    def _compare(self, table: Table, row: Row, existing: Row) -> None:
        """Raise StoreError if a row differs from the merged store's row of the same key."""
        for name in table.names:
            if row[name] != existing[name]:
                self._raise_difference(table, row, name, row[name], existing[name])

    def _compare_recorded(self, run: Row, original_run: Row) -> None:
        """Raise StoreError if a run has recorded values of other names than the same run of the merged store.

        ``original_run`` is the run with the numbers that it has in the store that is being added.
        """
        has_key = " AND ".join(f"{name} = ?" for name in RUN.key)
        query = f"SELECT name FROM recorded WHERE {has_key}"
        new_names = {name for (name,) in self._source.execute(query, [original_run[name] for name in RUN.key])}
        old_names = {name for (name,) in self._connection.execute(query, [run[name] for name in RUN.key])}
        if new_names != old_names:
            self._raise_difference(RECORDED, run, "records", sorted(new_names), sorted(old_names))

    def _insert(self, table: Table, row: Row, otherwise: str = "") -> bool:
        """Insert a row; return whether it was added. With ``otherwise`` ``OR IGNORE``, a row whose key exists is not."""
        cells = [row.get(name) for name in table.names]
        return self._connection.execute(insert_sql(table, otherwise), cells).rowcount > 0

    def _merged_rows(self, table: Table, rest: str = "", *values: Any) -> list[Row]:
        """Return rows of the merged store; ``rest`` is SQL from WHERE on."""
        return list(read_rows(self._merged, self._connection, table, rest, *values))

    def _add_numbered(self, table: Table, row: Row) -> None:
        """Add a row under the table's next number."""
        new_number = self._last_numbers[table.name] + 1
        self._last_numbers[table.name] = new_number
        self._new_numbers[table.name][row["id"]] = new_number
        self._insert(table, {**row, "id": new_number})

    def _add_experiment(self, row: Row) -> None:
        """Add an experiment. If the merged store has an experiment of this name, unite both.

        The two may differ in the number of environments and in the number of runs in other realities; the larger number
        is kept. They may also differ in whether their sweep has ended. Raises StoreError if they differ in anything else.
        """
        facts = json.loads(row["facts"])
        run_count_at_end = facts.pop(ENDED, None)
        self._run_counts_at_end.setdefault(row["id"], set()).add(run_count_at_end)
        (row["position"],) = self._connection.execute("SELECT count(*) FROM experiment").fetchone()
        is_new = self._insert(EXPERIMENT, row, "OR IGNORE")
        if is_new:
            return
        (existing,) = self._merged_rows(EXPERIMENT, "WHERE id = ?", row["id"])
        for name in SAME_COLUMNS:
            if row[name] != existing[name]:
                self._raise_difference(EXPERIMENT, row, name, row[name], existing[name])
        existing_facts = json.loads(existing["facts"])
        existing_facts.pop(ENDED, None)
        merged_row = {
            **existing,
            "environments": max(row["environments"], existing["environments"]),
            "facts": json.dumps(self._united_facts(row, facts, existing_facts)),
        }
        self._insert(EXPERIMENT, merged_row, "OR REPLACE")

    def _united_facts(self, row: Row, facts: dict[str, Any], existing_facts: dict[str, Any]) -> dict[str, Any]:
        """Return the facts of an experiment that is in both stores: the store being added and the merged one.

        Facts are values by name. ``facts`` and ``row`` are from the store being added, ``existing_facts`` from the merged
        one. Both must be equal, except for the facts on runs in other realities. Of these, the facts of the store with
        more such runs are returned. Raises StoreError if other facts differ.
        """
        # This also removes them from the two dictionaries, which are compared then.
        reality_facts = _taken_reality_facts(facts)
        existing_reality_facts = _taken_reality_facts(existing_facts)
        for name in sorted(facts.keys() | existing_facts.keys()):
            if facts.get(name) != existing_facts.get(name):
                self._raise_difference(EXPERIMENT, row, name, facts.get(name), existing_facts.get(name))
        has_more_runs = reality_facts.get("realities", 0) > existing_reality_facts.get("realities", 0)
        kept_reality_facts = reality_facts if has_more_runs else existing_reality_facts
        return {**existing_facts, **kept_reality_facts}

    def _add_trial(self, path: Path, row: Row) -> None:
        """Add a trial with its log. If the merged store has a copy of the trial, with the same UUID, keep the newer one.

        A copy is newer if the other one is still running, or if the other one has only a part of its corrections. Raises
        StoreError if neither copy is newer and they differ.
        """
        if row["log"] is not None:
            row["log"] = self._log_copies.plan(path, row)
        copies = self._merged_rows(TRIAL, "WHERE uuid = ?", row["uuid"])
        if not copies:
            self._add_numbered(TRIAL, row)
            return
        (existing,) = copies
        self._new_numbers[TRIAL.name][row["id"]] = existing["id"]
        row["id"] = existing["id"]
        _share_values(row, existing)
        of_trial = "WHERE trial_id = (SELECT id FROM trial WHERE uuid = ?)"
        corrections = _changes(read_rows(path, self._source, CORRECTION, of_trial, row["uuid"]))
        existing_corrections = _changes(self._corrections(existing["id"]))
        # `a < b` means that the set a is a part of b, and that b has more.
        is_newer = existing["ending"] == RUNNING or existing_corrections < corrections
        is_older = row["ending"] == RUNNING or corrections < existing_corrections
        if not is_newer and not is_older:
            self._compare(TRIAL, row, existing)
        self._insert(TRIAL, row if is_newer else existing, "OR REPLACE")

    def _corrections(self, trial: int) -> list[Row]:
        """Return the merged store's corrections of a trial."""
        return self._merged_rows(CORRECTION, "WHERE trial_id = ?", trial)

    def end(self) -> None:
        """Finish the merge: mark the experiments whose sweep has ended. Raises StoreError.

        When a sweep ends, it stores how many runs the experiment has. The runs of several stores together may be more
        than that. The merged sweep has ended if the experiment has just as many runs as at the end of one of the sweeps.
        """
        for row in self._merged_rows(EXPERIMENT):
            facts = json.loads(row["facts"])
            run_count = sum(design_counts(self._merged, self._connection, row["id"]).runs)
            marked_run_count = facts.pop(ENDED, None)
            if marked_run_count == run_count:
                continue
            if run_count in self._run_counts_at_end[row["id"]]:
                facts[ENDED] = run_count
            self._insert(EXPERIMENT, {**row, "facts": json.dumps(facts)}, "OR REPLACE")

    def _raise_difference(self, table: Table, row: Row, name: str, value: Any, earlier_value: Any) -> NoReturn:
        """Raise a StoreError about a value that differs between the store that is being added and the earlier ones.

        ``name`` is the name of the value in ``row`` of ``table``. It is ``value`` in the added store.
        """
        added_store, earlier_stores = self._added_stores[-1], self._added_stores[:-1]
        earlier_text = ", ".join(str(store) for store in earlier_stores) or str(self._merged)
        value_text = shown_value(self._connection, name, value)
        earlier_value_text = shown_value(self._connection, name, earlier_value)
        values_text = f"{name} is {value_text} in {added_store}, {earlier_value_text} in {earlier_text}"
        if table is EXPERIMENT:
            start, end = f'experiment "{row["id"]}": ', ": give one of them another name and sweep it again"
        elif table is DESIGN:
            start = f'experiment "{row["experiment"]}": design {row["position"] + 1}: '
            end = ": give one of them another name and sweep it again"
        elif table is TRIAL:
            number = self._number_in_added_store(TRIAL, row["id"])
            start, end = f"trial {number} of {added_store} ({row['uuid']}): ", ": correct one of them"
        else:
            start, end = f"{key_with_values(self._connection, table, row)}: ", ""
            if table in (RUN, RECORDED, REALITY_RUN):
                end = ": the same build gave two results, so one of them is not that build"
        raise StoreError(f"{start}{values_text}{end}")

    def _number_in_added_store(self, table: Table, new_number: int) -> int:
        """Return the number that a row has in the store that is being added, by its number in the merged store."""
        for number, merged_number in self._new_numbers[table.name].items():
            if merged_number == new_number:
                return number
        raise KeyError(new_number)
