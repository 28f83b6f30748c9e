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
from collections.abc import Iterable, Sequence
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
# In messages, longer values are cut, and a row is named by the first digits of its hash.
MAX_SHOWN, HASH_DIGITS = 80, 12
# The columns that distinguish the corrections of a trial: all except the numbers of correction and trial.
CHANGE = CORRECTION.names[2:]


def merge_stores(stores: Sequence[Path], merged: Path) -> dict[str, int]:
    """Create the store ``merged`` with the contents of several stores. Return its number of rows by table.

    The logs of the trials are copied beside it. Raises StoreError if ``merged`` exists, or if the stores contradict each
    other; then nothing is created.
    """
    check_new(merged)
    copied: list[Path] = []
    try:
        with new_store(merged) as connection:
            merge = Merge(connection, merged)
            for path in stores:
                with contextlib.closing(connect_reading(path)) as source, store_errors(path):
                    source.execute("BEGIN")
                    # The first missing reference is enough for an error.
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


def _taken_reality_facts(facts: dict[str, Any]) -> dict[str, Any]:
    """Remove the facts on runs in other realities from an experiment's facts, and return them."""
    return {name: facts.pop(name) for name in REALITY_FACTS if name in facts}


def _changes(corrections: Iterable[Row]) -> set[tuple[Any, ...]]:
    """Return what corrections change; their own numbers and that of the trial differ between stores."""
    return {tuple(correction[name] for name in CHANGE) for correction in corrections}


class Merge:
    """Adds stores to the store ``merged``, one after another. ``logs`` maps the logs to copy to their new files."""

    def __init__(self, connection: sqlite3.Connection, merged: Path) -> None:
        self._connection = connection
        self._merged = merged
        # The log files that must be copied, each with the path of its copy.
        self.logs: dict[Path, Path] = {}
        self._stores: list[Path] = []
        # The store that is being added. Its rows get new numbers; these are kept by table and old number.
        self._source = connection
        self._numbers: dict[str, dict[int, int]] = {}
        # The highest number of a row in each table of the merged store.
        self._last = {table.name: self._last_number(table) for table in TABLES}
        # How many runs the sweeps of each experiment had when they ended. A sweep that has not ended has None.
        self._ended: dict[str, set[int | None]] = {}

    def _last_number(self, table: Table) -> int:
        """Return the greatest number of a table's rows; 0 if they have no numbers."""
        if ("id", "INTEGER") not in [(column.name, column.type) for column in table.columns]:
            return 0
        return int(self._connection.execute(f"SELECT coalesce(max(id), 0) FROM {table.name}").fetchone()[0])

    def add(self, path: Path, source: sqlite3.Connection, tables: Sequence[Table] = TABLES) -> None:
        """Add all rows of a store, or of some of its tables. Raises StoreError if they contradict earlier stores."""
        # A store with impossible numbers is refused by all commands, and so would be the merged store. The first such
        # number is enough for an error.
        for damage in numbers_beyond_limits(source):
            raise StoreError(f"{path}: {damage}")
        self._stores.append(path)
        self._source = source
        self._numbers = {table.name: {} for table in tables}
        earlier_design_counts = dict(self._connection.execute(DESIGN_COUNTS).fetchall())
        for table in tables:
            order = ("position",) if table is EXPERIMENT else table.order or table.key
            for row in read_rows(path, source, table, f"ORDER BY {', '.join(order)}"):
                self._add_source_row(path, table, row)
        # The rows above are compared one by one. If a store has more or fewer designs of an experiment than another,
        # none of these comparisons shows it.
        for experiment, count in source.execute(DESIGN_COUNTS):
            earlier_count = earlier_design_counts.get(experiment, count)
            if earlier_count != count:
                self._raise_difference(EXPERIMENT, {"id": experiment}, "designs", count, earlier_count)

    def _add_source_row(self, path: Path, table: Table, row: Row) -> None:
        """Add a row of the store at ``path`` to the merged store, after giving it the numbers of the merged store."""
        # The key of a run in its own store, by which its recorded values are found there.
        source_key = tuple(row.get(name) for name in RUN.key)
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
            self._add_row(table, row, source_key)

    def _renumber(self, table: Table, row: Row) -> None:
        """Replace the numbers of other rows, to which a row refers, by their numbers in the merged store."""
        for column in table.columns:
            referred_table = column.refers or REFERENCES.get(column.name)
            # An experiment is referred to by its name, which stays.
            if referred_table in (None, EXPERIMENT.name) or row[column.name] is None:
                continue
            row[column.name] = self._numbers[referred_table][row[column.name]]

    def _add_correction(self, row: Row) -> None:
        """Add a correction of a trial, unless the merged store has an equal one."""
        for existing in self._corrections(row["trial_id"]):
            # The numbers of corrections differ between stores.
            if {**existing, "id": row["id"]} == row:
                return
        self._add_numbered(CORRECTION, row)

    def _add_row(self, table: Table, row: Row, source_key: tuple[Any, ...]) -> None:
        """Add a row of a table whose rows are not identified by their numbers.

        If the merged store has the row already, both must be equal, or this raises StoreError. If the row is a run,
        ``source_key`` is its key in the store that is being added.
        """
        source_number = row.get("id")
        # The rows of some tables are identified by a unique column, such as a hash. They get the next number of the
        # merged store, or keep the number of the equal row that it has already.
        if table.unique:
            row["id"] = self._last[table.name] + 1
        if self._insert(table, row, "OR IGNORE"):
            self._last[table.name] += 1
        elif table is STUDY:
            self._keep_earliest_creation(row)
        else:
            # The merged store has the row. This compares both, and takes over the number of the existing one.
            self._unite(table, row)
            if table is RUN:
                self._compare_recorded(row, source_key)
        if source_number is not None:
            self._numbers[table.name][source_number] = row["id"]

    def _keep_earliest_creation(self, row: Row) -> None:
        """Keep the facts of the first store, but the earliest time of creation."""
        (existing,) = self._merged_rows(STUDY, "WHERE key = ?", row["key"])
        if row["key"] == "created_utc" and row["value"] < existing["value"]:
            self._insert(STUDY, row, "OR REPLACE")

    def _unite(self, table: Table, row: Row) -> None:
        """Compare a row with the existing row of the merged store with the same key. Raises StoreError if they differ.

        ``row`` gets the number of the existing row. In some tables one of the two may lack a value that the other one
        has. Then the merged store gets the value.
        """
        key = (table.unique,) if table.unique else table.key
        where = " AND ".join(f"{name} = ?" for name in key)
        (existing,) = self._merged_rows(table, f"WHERE {where}", *(row[name] for name in key))
        if table.name in MAY_BE_UNKNOWN:
            name = MAY_BE_UNKNOWN[table.name]
            if existing[name] is None and row[name] is not None:
                existing[name] = row[name]
                self._insert(table, existing, "OR REPLACE")
            elif row[name] is None:
                row[name] = existing[name]
        row["id"] = existing.get("id")
        self._compare(table, row, existing)

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
        """Add an experiment. If the merged store has an experiment of this name, unite both.

        The two may differ in three things. If they have different numbers of environments, the larger one is kept. The
        same holds for the number of runs in other realities. And one of the sweeps may have ended, the other not. Raises
        StoreError if they differ in anything else.
        """
        facts = json.loads(row["facts"])
        self._ended.setdefault(row["id"], set()).add(facts.pop(ENDED, None))
        (row["position"],) = self._connection.execute("SELECT count(*) FROM experiment").fetchone()
        if self._insert(EXPERIMENT, row, "OR IGNORE"):
            return
        (existing,) = self._merged_rows(EXPERIMENT, "WHERE id = ?", row["id"])
        existing_facts = json.loads(existing["facts"])
        existing_facts.pop(ENDED, None)
        reality_facts, existing_reality_facts = _taken_reality_facts(facts), _taken_reality_facts(existing_facts)
        if reality_facts.get("realities", 0) <= existing_reality_facts.get("realities", 0):
            reality_facts = existing_reality_facts
        for name in SAME_COLUMNS:
            if row[name] != existing[name]:
                self._raise_difference(EXPERIMENT, row, name, row[name], existing[name])
        for name in sorted(facts.keys() | existing_facts.keys()):
            if facts.get(name) != existing_facts.get(name):
                self._raise_difference(EXPERIMENT, row, name, facts.get(name), existing_facts.get(name))
        merged_row = {
            **existing,
            "environments": max(row["environments"], existing["environments"]),
            "facts": json.dumps({**existing_facts, **reality_facts}),
        }
        self._insert(EXPERIMENT, merged_row, "OR REPLACE")

    def _add_trial(self, path: Path, row: Row) -> None:
        """Add a trial with its log. If the merged store has a copy of the trial, with the same UUID, keep the newer one.

        A copy is newer if the other one is still running, or if the other one has only a part of its corrections. Raises
        StoreError if neither copy is newer and they differ.
        """
        if row["log"] is not None:
            row["log"] = self._log(path, row)
        copies = self._merged_rows(TRIAL, "WHERE uuid = ?", row["uuid"])
        if not copies:
            self._add_numbered(TRIAL, row)
            return
        (existing,) = copies
        self._numbers[TRIAL.name][row["id"]] = existing["id"]
        row = {**row, "id": existing["id"]}
        # A copy that was imported from a table lacks some values. It takes them from the other copy.
        for name in UNKNOWN_IF_IMPORTED:
            if row[name] is None:
                row[name] = existing[name]
            existing[name] = row[name]
        # The texts of such a copy may differ although they mean the same: a table may write a number in another way, and
        # shortens spaces.
        for name, meaning in (("design", json.loads), ("deviations", json.loads), ("note", str.split)):
            if meaning(row[name]) == meaning(existing[name]):
                row[name] = existing[name]
        of_trial = "WHERE trial_id = (SELECT id FROM trial WHERE uuid = ?)"
        corrections = _changes(read_rows(path, self._source, CORRECTION, of_trial, row["uuid"]))
        existing_corrections = _changes(self._corrections(existing["id"]))
        # These are sets, and `<` says whether a set is a proper part of another one.
        is_newer = existing["ending"] == RUNNING or existing_corrections < corrections
        is_older = row["ending"] == RUNNING or corrections < existing_corrections
        if not is_newer and not is_older:
            self._compare(TRIAL, row, existing)
        self._insert(TRIAL, row if is_newer else existing, "OR REPLACE")

    def _corrections(self, trial: int) -> list[Row]:
        """Return the merged store's corrections of a trial."""
        return self._merged_rows(CORRECTION, "WHERE trial_id = ?", trial)

    def _log(self, path: Path, trial: Row) -> str:
        """Plan to copy a trial's log into the folder of the merged store, and return the name of the copy.

        If another log has its name, a part of the trial's UUID is added to the name. Raises StoreError if this name is
        taken, too.
        """
        source, name = log_file(path, trial["log"]), trial["log"]
        digest = sha256_of(source)
        if digest is None:
            # The log is missing, so there is nothing to copy.
            return str(name)
        logs_by_target = {target: log for log, target in self.logs.items()}
        for candidate in (Path(name), Path(name).with_stem(f"{Path(name).stem}-{trial['uuid'][:8]}")):
            target = log_file(self._merged, str(candidate))
            # Another log may be planned for this name, or a file of this name may exist.
            log_of_this_name = logs_by_target.get(target, target)
            is_free_or_equal = sha256_of(log_of_this_name) in (None, digest)
            if is_free_or_equal:
                if not os.path.lexists(target):
                    self.logs[source] = target
                return str(candidate)
        raise StoreError(f"{target}: already exists with other contents; move it away first")

    def end(self) -> None:
        """Finish the merge: decide for each experiment whether its sweep has ended. Raises StoreError.

        A sweep has stored how many runs it had at its end. If the merged experiment has as many runs as one of the sweeps
        had, it is marked as ended.
        """
        for row in self._merged_rows(EXPERIMENT):
            facts = json.loads(row["facts"])
            runs = sum(design_counts(self._merged, self._connection, row["id"]).runs)
            if facts.pop(ENDED, None) == runs:
                # The row says already, and correctly, that the sweep has ended.
                continue
            if runs in self._ended[row["id"]]:
                facts[ENDED] = runs
            self._insert(EXPERIMENT, {**row, "facts": json.dumps(facts)}, "OR REPLACE")

    def _raise_difference(self, table: Table, row: Row, name: str, value: Any, before: Any) -> None:
        """Raise a StoreError about a value that differs between the added store and earlier ones.

        ``name`` is the name of the value in ``row`` of ``table``. It is ``value`` in the added store, and ``before`` in
        the earlier ones.
        """
        new, old = self._stores[-1], ", ".join(map(str, self._stores[:-1])) or self._merged
        values = f"{name} is {self._shown(name, value)} in {new}, {self._shown(name, before)} in {old}"
        if table in (EXPERIMENT, DESIGN):
            experiment = row["id"] if table is EXPERIMENT else row["experiment"]
            place = "" if table is EXPERIMENT else f"design {row['position'] + 1}: "
            raise StoreError(
                f'experiment "{experiment}": {place}{values}: give one of them another name and sweep it again'
            )
        if table is TRIAL:
            # The row has the trial's number in the merged store; the message needs that in the added store.
            number_in_source = {merged: number for number, merged in self._numbers[TRIAL.name].items()}
            number = number_in_source[row["id"]]
            raise StoreError(f"trial {number} of {new} ({row['uuid']}): {values}: correct one of them")
        is_run = table in (RUN, RECORDED, REALITY_RUN)
        shown_table = RUN if table is RECORDED else table
        key = ", ".join(f"{column} {self._shown(column, row.get(column))}" for column in shown_table.key)
        explanation = ": the same build gave two results, so one of them is not that build" if is_run else ""
        raise StoreError(f"{shown_table.name} ({key}): {values}{explanation}")

    def _shown(self, column: str, value: Any) -> str:
        """Return a value of a column as text for a message.

        A number of another row means nothing to a person. It is replaced by the name of a build, or by the first digits
        of a hash.
        """
        referred = BY_NAME.get(column.removesuffix("_id")) if column.endswith("_id") else None
        if value is not None and referred is not None and referred.unique:
            length = MAX_SHOWN if referred is BUILD else HASH_DIGITS
            query = f"SELECT substr({referred.unique}, 1, ?) FROM {referred.name} WHERE id = ?"
            (value,) = self._connection.execute(query, (length, value)).fetchone()
        text = value if isinstance(value, str) else json.dumps(value)
        return text if len(text) <= MAX_SHOWN else f"{text[: MAX_SHOWN - 3]}…"
