"""One store of several: the rows of each under the numbers of the new one, every row once.

Input: stores of this version. Output: a new store, or nothing. Rows are equal by what they say, not by their numbers: a
body by its hash, a run by its key. A run that has other results in two stores means that a build is not what its name
says, and an experiment of which two stores say different things is two experiments: both are errors.
"""

import contextlib
import json
import sqlite3
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

from foldcar.store.design_counts import design_counts
from foldcar.store.endings import ENDING_FACTS, Ending, merged_ending
from foldcar.store.errors import StoreError
from foldcar.store.log_files import log_file, sha256_of
from foldcar.store.opening import check_new, connect_reading, new_store, require_version
from foldcar.store.rows import Row, insert_sql, key_text, read_rows, stored
from foldcar.store.tables import BY_NAME, CORRECTION, DESIGN, ENVIRONMENT, EXPERIMENT, RUN, STUDY, TABLES, TRIAL, Table

LOG_NUMBERS = 10_000


def merge_stores(stores: Sequence[Path], merged: Path) -> dict[str, int]:
    """Make the store ``merged``, which must not exist; gives its number of rows by table. StoreError."""
    check_new(merged)
    with contextlib.ExitStack() as stack:
        sources = [(path, stack.enter_context(_reading(path))) for path in stores]
        with new_store(merged) as (connection, logs):
            merge = _Merge(connection, merged, logs)
            for path, source in sources:
                merge.add(path, source)
            merge.end_experiments()
            return {
                table.name: connection.execute(f"SELECT count(*) FROM {table.name}").fetchone()[0] for table in TABLES
            }


@contextlib.contextmanager
def _reading(path: Path) -> Iterator[sqlite3.Connection]:
    with contextlib.closing(connect_reading(path)) as connection:
        require_version(path, connection)
        connection.execute("BEGIN")
        yield connection


class _Merge:
    """Adds stores to a new one, one after the other."""

    def __init__(
        self, connection: sqlite3.Connection, merged: Path, logs: list[tuple[Path, Path, str | None]]
    ) -> None:
        self._connection = connection
        self._merged = merged
        self._logs = logs
        self._stores: list[Path] = []
        # Of the store that is being added: its numbers of rows, and those here.
        self._numbers: dict[str, dict[int, int]] = {}
        # Trials of the stores before, by what they say.
        self._trials: dict[tuple[Any, ...], list[int]] = {}
        self._logged: dict[str | None, Row] = {}
        # How the sweeps of each experiment ended, a store each.
        self._endings: dict[str, list[Ending]] = {}

    def add(self, path: Path, source: sqlite3.Connection) -> None:
        """Add all rows of a store. StoreError if they contradict those there."""
        self._stores.append(path)
        self._numbers = {}
        self._trials, self._logged = {}, {}
        if len(self._stores) > 1:
            for row in read_rows(self._merged, self._connection, TRIAL, "ORDER BY id DESC"):
                self._trials.setdefault(_said(row), []).append(row["id"])
                if row["log_sha256"] is not None:
                    self._logged[row["log_sha256"]] = row
        special: dict[str, Callable[[Row], None]] = {
            STUDY.name: self._study, EXPERIMENT.name: self._experiment, TRIAL.name: self._trial,
            CORRECTION.name: self._correction,
        }  # fmt: skip
        for table in TABLES:
            self._numbers[table.name] = {}
            order = "position" if table is EXPERIMENT else ", ".join(table.order or table.key)
            for row in read_rows(path, source, table, f"ORDER BY {order}"):
                if table is TRIAL and row["log"] is not None:
                    row["log"] = self._log(path, row)
                recorded = _recorded(source, row) if table is RUN else 0
                for column in table.columns:
                    # `recorded` refers to runs by all of their key.
                    referred = column.name.removesuffix("_id") if column.name in RUN.key else column.refers
                    if column.type == "INTEGER" and referred and row[column.name] is not None:
                        row[column.name] = self._number(path, table, row, referred, column.name)
                if table.name in special:
                    special[table.name](row)
                elif table.unique:
                    self._numbered(table, row)
                elif not self._keyed(table, row) and table is RUN:
                    known = _recorded(self._connection, row)
                    if recorded != known:
                        self._differs(RUN, row, "the number of recorded values", recorded, known)
        self._check_designs(source)

    def _number(self, path: Path, table: Table, row: Row, referred: str, column: str) -> int:
        try:
            return self._numbers[referred][row[column]]
        except KeyError:
            raise StoreError(f"{path}: {key_text(table, row)}: refers to a row of {referred} that is not there") from None

    def _insert(self, table: Table, row: Row, otherwise: str = "") -> bool:
        """Whether the row was added; with ``OR IGNORE`` not if its key is there."""
        cells = tuple(stored(table, row).values())
        return self._connection.execute(insert_sql(table, otherwise), cells).rowcount > 0

    def _next(self, table: Table, column: str = "id") -> int:
        (last,) = self._connection.execute(f"SELECT max({column}) FROM {table.name}").fetchone()
        return 0 if last is None else int(last) + 1

    def _there(self, table: Table, columns: Sequence[str], row: Row) -> Row:
        """The row of the new store that has the same values in these columns."""
        where = " AND ".join(f"{name} = ?" for name in columns)
        values = (row[name] for name in columns)
        return next(read_rows(self._merged, self._connection, table, f"WHERE {where}", *values))

    def _numbered(self, table: Table, row: Row) -> None:
        """A row that a column besides its number tells apart."""
        assert table.unique
        old = row["id"]
        row = {**row, "id": self._next(table) or 1}
        if not self._insert(table, row, "OR IGNORE"):
            there = self._there(table, [table.unique], row)
            if table is ENVIRONMENT and there["dynamic"] is None:
                self._insert(table, {**row, "id": there["id"]}, "OR REPLACE")
            elif row.get("dynamic", 0) is not None:
                self._compare(table, row, there, ("id",))
            row["id"] = there["id"]
        self._numbers[table.name][old] = row["id"]

    def _keyed(self, table: Table, row: Row) -> bool:
        """Whether the row was added; if not, it is there."""
        added = self._insert(table, row, "OR IGNORE")
        if not added:
            self._compare(table, row, self._there(table, table.key, row), ())
        return added

    def _study(self, row: Row) -> None:
        """The facts of the first store, and the earliest time of creation."""
        if not self._insert(STUDY, row, "OR IGNORE") and row["key"] == "created_utc":
            there = self._there(STUDY, ["key"], row)
            self._insert(STUDY, min(row, there, key=lambda one: str(one["value"])), "OR REPLACE")

    def _experiment(self, row: Row) -> None:
        """An experiment; one that differs in its number of environments, or in when it stopped, is the same."""
        row["position"] = self._next(EXPERIMENT, "position")
        facts = json.loads(row["facts"])
        ending = Ending(self._stores[-1], row["environments"], facts.pop("until", None), facts.pop("ended_runs", None))
        self._endings.setdefault(row["id"], []).append(ending)
        if self._insert(EXPERIMENT, row, "OR IGNORE"):
            return
        there = self._there(EXPERIMENT, ["id"], row)
        known = {name: value for name, value in json.loads(there["facts"]).items() if name not in ENDING_FACTS}
        for name in sorted(facts.keys() | known.keys()):
            if facts.get(name) != known.get(name):
                self._differs(EXPERIMENT, row, name, facts.get(name), known.get(name))
        self._compare(EXPERIMENT, row, there, ("position", "environments", "facts", "designs", "designs_fingerprint"))
        if row["environments"] > there["environments"]:
            self._insert(EXPERIMENT, {**there, "environments": row["environments"]}, "OR REPLACE")

    def end_experiments(self) -> None:
        """Say of each experiment when its sweeps stopped. StoreError if that is not one rule."""
        for name, endings in self._endings.items():
            row = self._there(EXPERIMENT, ["id"], {"id": name})
            facts = {key: value for key, value in json.loads(row["facts"]).items() if key not in ENDING_FACTS}
            counts = design_counts(self._merged, self._connection, name)
            facts |= merged_ending(name, endings, row["environments"], len(counts.positions), sum(counts.runs))
            if facts != json.loads(row["facts"]):
                self._insert(EXPERIMENT, {**row, "facts": json.dumps(facts)}, "OR REPLACE")

    def _trial(self, row: Row) -> None:
        old, same = row["id"], self._trials.get(_said(row))
        if same:
            # Each trial of the stores before is at most one of this store's.
            self._numbers[TRIAL.name][old] = same.pop()
            return
        if (there := self._logged.get(row["log_sha256"])) is not None:
            # The same drive, of which one store says something else.
            self._compare(TRIAL, row, there, ("id",))
        self._numbers[TRIAL.name][old] = number = self._next(TRIAL) or 1
        self._insert(TRIAL, {**row, "id": number})

    def _correction(self, row: Row) -> None:
        names = [name for name in CORRECTION.names if name != "id"]
        where = " AND ".join(f"{name} IS ?" for name in names)
        found = read_rows(self._merged, self._connection, CORRECTION, f"WHERE {where}", *(row[name] for name in names))
        if next(found, None) is None:
            self._insert(CORRECTION, {**row, "id": self._next(CORRECTION) or 1})

    def _log(self, path: Path, row: Row) -> str:
        """The name of a trial's log in the new store's folder; its file is to be copied there if it is elsewhere."""
        log = str(row["log"])
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

    def _check_designs(self, source: sqlite3.Connection) -> None:
        """StoreError if an experiment of the store that was added has fewer designs than the one there."""
        counts = "SELECT experiment, count(*) FROM design GROUP BY 1"
        here: Counter[str] = Counter(dict(self._connection.execute(counts).fetchall()))
        for experiment, count in source.execute(counts):
            if count != here[experiment]:
                row = {"id": experiment}
                self._differs(EXPERIMENT, row, "designs", count, here[experiment])

    def _compare(self, table: Table, row: Row, there: Row, except_: Sequence[str]) -> None:
        for name in table.names:
            if name not in except_ and row[name] != there[name]:
                self._differs(table, row, name, row[name], there[name])

    def _differs(self, table: Table, row: Row, name: str, value: Any, before: Any) -> None:
        """Raise the StoreError that says which store says what."""
        new, old = self._stores[-1], ", ".join(map(str, self._stores[:-1]))
        if name.endswith("_id"):
            name = name.removesuffix("_id")
            value, before = self._named(name, value), self._named(name, before)
        values = f"{name} is {_short(value)} in {new}, {_short(before)} in {old}"
        if table.name in (RUN.name, "recorded"):
            key = self._run_key(row)
            raise StoreError(f"{key}: {values}: the same build gave two results, so one of them is not that build")
        if table in (EXPERIMENT, DESIGN):
            experiment = row["id"] if table is EXPERIMENT else row["experiment"]
            place = "" if table is EXPERIMENT else f"design {row['position'] + 1}: "
            raise StoreError(f'experiment "{experiment}": {place}{values}: give one of them another name and sweep it')
        names = {
            key.removesuffix("_id"): self._named(key.removesuffix("_id"), row[key]) if key.endswith("_id") else row[key]
            for key in table.key
        }
        raise StoreError(f"{table.name} ({', '.join(f'{key} {value}' for key, value in names.items())}): {values}")

    def _run_key(self, row: Row) -> str:
        """A run by the name of its build and the hashes of the rest."""
        tables = [column.removesuffix("_id") for column in RUN.key]
        named = (f"{table} {self._named(table, row[table + '_id'])}" for table in tables)
        return f"run ({', '.join(named)})"

    def _named(self, table: str, number: Any) -> str:
        """What a row is called in messages instead of its number: a build's name, a hash's beginning."""
        unique = BY_NAME[table].unique if table in BY_NAME else None
        if unique is None or number is None:
            return str(number)
        (text,) = self._connection.execute(f"SELECT {unique} FROM {table} WHERE id = ?", (number,)).fetchone()
        return str(text) if table == "build" else str(text)[:12]


def _recorded(connection: sqlite3.Connection, run: Row) -> int:
    """How many values were recorded in a run."""
    where = " AND ".join(f"{name} = ?" for name in RUN.key)
    values = [run[name] for name in RUN.key]
    (count,) = connection.execute(f"SELECT count(*) FROM recorded WHERE {where}", values).fetchone()
    return int(count)


def _said(trial: Row) -> tuple[Any, ...]:
    """What a trial says, its number aside."""
    return tuple(trial[name] for name in TRIAL.names if name != "id")


def _short(value: Any) -> str:
    text = value if isinstance(value, str) else json.dumps(value)
    return text if len(text) <= 80 else f"{text[:77]}…"
