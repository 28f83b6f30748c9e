"""One store of several: the rows of each under the numbers of the new one, every row once.

Input: stores of this version. Output: a new store, or nothing. Rows are equal by what they say, not by their numbers: a
body by its hash, a run by its key. A run that has other results in two stores means that a build is not what its name
says, and an experiment of which two stores say different things is two experiments: both are errors.
"""

import contextlib
import json
import sqlite3
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from foldcar.store.check import references
from foldcar.store.connection import transaction
from foldcar.store.designs import design_counts
from foldcar.store.errors import StoreError, store_errors
from foldcar.store.log_files import log_file, sha256_of
from foldcar.store.opening import check_new, connect_reading, new_store, refuse_damaged_log, require_version
from foldcar.store.rows import Row, checksum, insert_sql, read_rows, stored
from foldcar.store.tables import (
    BY_NAME,
    CHECKSUM,
    CORRECTION,
    DESIGN,
    ENVIRONMENT,
    EXPERIMENT,
    PATH,
    RECORDED,
    RUN,
    STUDY,
    TABLES,
    TRIAL,
    Table,
)

LOG_NUMBERS = 10_000
# An experiment's facts of ExperimentInfo on its end.
ENDING_FACTS = ("until", "ended_runs")
RUN_KEY = ", ".join(RUN.key)


# How the sweep of an experiment ended in a store: its number of environments, and the facts, None without.
Ending = tuple[Path, int, Any, int | None]


def merge_stores(stores: Sequence[Path], merged: Path) -> dict[str, int]:
    """Make the store ``merged``, which must not exist; gives its number of rows by table. StoreError."""
    check_new(merged)
    for path in stores:
        _verify(path)
    with new_store(merged) as (connection, logs), store_errors(merged):
        merge = _Merge(connection, merged, logs)
        for path in stores:
            connection.execute("ATTACH ? AS source", (f"{path.resolve().as_uri()}?mode=ro",))
            with transaction(path, connection):
                merge.add(path)
            connection.execute("DETACH source")
        with transaction(merged, connection):
            merge.end()
        return {
            table.name: connection.execute(f"SELECT count(*) FROM {table.name}").fetchone()[0] for table in TABLES
        }


def _verify(path: Path) -> None:
    """StoreError unless it is a store of this version, all of it whole."""
    with contextlib.closing(connect_reading(path)) as connection:
        refuse_damaged_log(path)
        require_version(path, connection)
        for table in TABLES:
            for _ in read_rows(path, connection, table):
                pass
        for lost in references(connection):
            raise StoreError(f"{path}: {lost}")


class _Merge:
    """Adds stores, attached as ``source``, to a new one, one after the other."""

    def __init__(
        self, connection: sqlite3.Connection, merged: Path, logs: list[tuple[Path, Path, str | None]]
    ) -> None:
        self._connection = connection
        self._merged = merged
        self._logs = logs
        self._stores: list[Path] = []
        # How the sweeps of each experiment ended, a store each.
        self._endings: dict[str, list[Ending]] = {}
        connection.create_function("checksum_of", -1, _checksum_of)
        for table in TABLES:
            if table.key == ("id",):
                connection.execute(f"CREATE TEMP TABLE number_{table.name} (old PRIMARY KEY, new)")

    def add(self, path: Path) -> None:
        """Add all rows of a store. StoreError if they contradict those there."""
        self._stores.append(path)
        for table in TABLES:
            self._connection.execute("DROP VIEW IF EXISTS temp.incoming")
            self._connection.execute(f"CREATE TEMP VIEW incoming AS {self._incoming_sql(table)}")
            if table is EXPERIMENT:
                self._add_experiments()
            elif table is TRIAL:
                self._add_trials(path)
            elif table is CORRECTION:
                self._add_corrections()
            else:
                self._add_rows(table)
        counts = "(SELECT count(*) FROM {}.design WHERE experiment = e.id)"
        for name, *designs in self._connection.execute(
            f"SELECT e.id, {counts.format('source')}, {counts.format('main')} FROM source.experiment e"
        ):
            if designs[0] != designs[1]:
                self._differs(EXPERIMENT, {"id": name}, "designs", *designs)

    def _incoming_sql(self, table: Table) -> str:
        """Rows of the attached store under the numbers of the new one; their own if they have none there yet."""
        there = {name for _, name, *_ in self._connection.execute(f"PRAGMA source.table_info({table.name})")}
        parts = []
        for column in table.columns:
            # `recorded` refers to runs by all of their key.
            referred = column.name.removesuffix("_id") if column.name in RUN.key else column.refers
            if column.name not in there:
                parts.append(f"NULL AS {column.name}")
            elif column.type == "INTEGER" and referred:
                parts.append(f"(SELECT new FROM number_{referred} WHERE old = r.{column.name}) AS {column.name}")
            else:
                parts.append(f"r.{column.name}")
        return f"SELECT {', '.join(parts)} FROM source.{table.name} r"

    def _add_rows(self, table: Table) -> None:
        """Rows that a number does not tell apart: one that is there already must be the same."""
        run = self._connection.execute
        key = (table.unique,) if table.unique else table.key
        if table is STUDY:
            # The facts of the first store, and the earliest time of creation.
            run("UPDATE main.study SET value = min(value, (SELECT value FROM incoming i WHERE i.key = 'created_utc')) "
                "WHERE key = 'created_utc'")  # fmt: skip
        elif table is ENVIRONMENT:
            run("UPDATE main.environment AS e SET dynamic = coalesce(dynamic, (SELECT dynamic FROM incoming i "
                "WHERE i.fingerprint = e.fingerprint))")  # fmt: skip
            self._compare(table, key, "i.dynamic NOT NULL AND i.dynamic IS NOT m.dynamic")
        else:
            others = [name for name in table.names if name not in (*key, "id")]
            self._compare(table, key, " OR ".join(f"i.{name} IS NOT m.{name}" for name in others) or "0")
        if table is RUN:
            run("DROP TABLE IF EXISTS temp.both")
            run(f"CREATE TEMP TABLE both AS SELECT {RUN_KEY} FROM incoming JOIN main.run USING ({RUN_KEY})")
        if table is RECORDED:
            self._compare_recorded()
        names = [name for name in table.names if name != "id"]
        run(f"INSERT OR IGNORE INTO main.{table.name} ({', '.join(names)}, {CHECKSUM}) "
            f"SELECT {', '.join(names)}, 0 FROM incoming ORDER BY {', '.join(table.order or table.key)}")  # fmt: skip
        if table.unique:
            run(f"DELETE FROM number_{table.name}")
            run(f"INSERT INTO number_{table.name} SELECT i.id, m.id FROM incoming i JOIN main.{table.name} m "
                f"USING ({table.unique})")  # fmt: skip

    def _compare(self, table: Table, key: Sequence[str], differ: str) -> None:
        """StoreError for the first row that is there with other values."""
        columns = ", ".join(f"{side}.{name}" for side in "im" for name in table.names)
        same = " AND ".join(f"i.{name} = m.{name}" for name in key)
        for cells in self._connection.execute(
            f"SELECT {columns} FROM incoming i JOIN main.{table.name} m ON {same} WHERE {differ} LIMIT 1"
        ):
            new, old = (dict(zip(table.names, part, strict=False)) for part in (cells, cells[len(table.names) :]))
            for name in table.names:
                if new[name] != old[name] and name != "id":
                    self._differs(table, new, name, new[name], old[name])

    def _compare_recorded(self) -> None:
        """StoreError if a run of both stores has a record in one of them only."""
        query = f"SELECT {RUN_KEY}, name FROM {{}} JOIN both USING ({RUN_KEY})"
        new, old = query.format("incoming"), query.format("main.recorded")
        for more, less, told in ((new, old, ("there", "missing")), (old, new, ("missing", "there"))):
            for cells in self._connection.execute(f"{more} EXCEPT {less} LIMIT 1"):
                row = dict(zip((*RUN.key, "name"), cells, strict=True))
                self._differs(RECORDED, row, f'record "{row["name"]}"', *told)

    def _incoming(self, table: Table, order: str) -> Iterator[Row]:
        for cells in self._connection.execute(f"SELECT * FROM incoming ORDER BY {order}").fetchall():
            yield dict(zip(table.names, cells, strict=True))

    def _insert(self, table: Table, row: Row, otherwise: str = "") -> bool:
        """Whether the row was added; with ``OR IGNORE`` not if its key is there."""
        cells = tuple(stored(table, row).values())
        return self._connection.execute(insert_sql(table, otherwise), cells).rowcount > 0

    def _there(self, table: Table, rest: str = "", *values: Any) -> list[Row]:
        cells = self._connection.execute(f"SELECT {', '.join(table.names)} FROM main.{table.name} {rest}", values)
        return [dict(zip(table.names, row, strict=True)) for row in cells]

    def _add_experiments(self) -> None:
        """Experiments; one that differs in its number of environments, or in when it stopped, is the same."""
        for row in self._incoming(EXPERIMENT, "position"):
            (row["position"],) = self._connection.execute("SELECT count(*) FROM main.experiment").fetchone()
            facts = json.loads(row["facts"])
            until, ended_runs = (facts.pop(name, None) for name in ENDING_FACTS)
            ending = self._stores[-1], row["environments"], until, ended_runs
            self._endings.setdefault(row["id"], []).append(ending)
            if self._insert(EXPERIMENT, row, "OR IGNORE"):
                continue
            (there,) = self._there(EXPERIMENT, "WHERE id = ?", row["id"])
            known = {name: value for name, value in json.loads(there["facts"]).items() if name not in ENDING_FACTS}
            for name in sorted(facts.keys() | known.keys()):
                if facts.get(name) != known.get(name):
                    self._differs(EXPERIMENT, row, name, facts.get(name), known.get(name))
            for name in ("build_id", "environment_id", "spread_id", "vehicle", "environment"):
                if row[name] != there[name]:
                    self._differs(EXPERIMENT, row, name, row[name], there[name])
            environments = max(row["environments"], there["environments"])
            self._insert(EXPERIMENT, {**there, "environments": environments}, "OR REPLACE")

    def _add_trials(self, path: Path) -> None:
        """Trials of built and simulated cars, with their logs; those of the stores before are told by what they say."""
        said: dict[tuple[Any, ...], list[int]] = {}
        logged: dict[str, Row] = {}
        for row in self._there(TRIAL, "ORDER BY id DESC"):
            said.setdefault(tuple(row.values())[1:], []).append(row["id"])
            if row["log_sha256"] is not None:
                logged[row["log_sha256"]] = row
        last = max((number for numbers in said.values() for number in numbers), default=0)
        self._connection.execute("DELETE FROM number_trial")
        for row in self._incoming(TRIAL, "id"):
            if row["log"] is not None:
                row["log"] = self._log(path, row["log"])
            old, same = row["id"], said.get(tuple(row.values())[1:])
            if same:
                # Each trial of the stores before is at most one of this store's.
                new = same.pop()
            else:
                for name, value in logged.get(row["log_sha256"], row).items():
                    # The same drive, of which one store says something else.
                    if name != "id" and row[name] != value:
                        self._differs(TRIAL, row, name, row[name], value)
                new = last = last + 1
                self._insert(TRIAL, {**row, "id": new})
            self._connection.execute("INSERT INTO number_trial VALUES (?, ?)", (old, new))

    def _add_corrections(self) -> None:
        there = {tuple(row.values())[1:] for row in self._there(CORRECTION)}
        for row in self._incoming(CORRECTION, "id"):
            if tuple(row.values())[1:] not in there:
                (last,) = self._connection.execute("SELECT max(id) FROM main.correction").fetchone()
                self._insert(CORRECTION, {**row, "id": (last or 0) + 1})

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
        """Say of each experiment when its sweeps stopped, and give rows their checksums. StoreError."""
        for name, endings in self._endings.items():
            (row,) = self._there(EXPERIMENT, "WHERE id = ?", name)
            facts = {key: value for key, value in json.loads(row["facts"]).items() if key not in ENDING_FACTS}
            counts = design_counts(self._merged, self._connection, name)
            facts |= _merged_ending(name, endings, row["environments"], len(counts.positions), sum(counts.runs))
            if facts != json.loads(row["facts"]):
                self._insert(EXPERIMENT, {**row, "facts": json.dumps(facts)}, "OR REPLACE")
        for table in TABLES:
            names = ", ".join(table.names)
            self._connection.execute(f"UPDATE {table.name} SET {CHECKSUM} = checksum_of('{table.name}', {names})")

    def _differs(self, table: Table, row: Row, name: str, value: Any, before: Any) -> None:
        """Raise the StoreError that says which store says what."""
        new, old = self._stores[-1], ", ".join(map(str, self._stores[:-1]))
        if name.endswith("_id"):
            name = name.removesuffix("_id")
            value, before = self._named(name, value), self._named(name, before)
        values = f"{name} is {_short(value)} in {new}, {_short(before)} in {old}"
        if table in (EXPERIMENT, DESIGN):
            experiment = row["id"] if table is EXPERIMENT else row["experiment"]
            place = "" if table is EXPERIMENT else f"design {row['position'] + 1}: "
            raise StoreError(f'experiment "{experiment}": {place}{values}: give one of them another name and sweep it')
        is_run = table in (RUN, RECORDED, PATH)
        keys = [key.removesuffix("_id") for key in (RUN if is_run else table).key]
        told = ", ".join(f"{key} {self._named(key, row.get(f'{key}_id', row.get(key)))}" for key in keys)
        why = ": the same build gave two results, so one of them is not that build" if is_run else ""
        raise StoreError(f"{'run' if is_run else table.name} ({told}): {values}{why}")

    def _named(self, table: str, number: Any) -> str:
        """What a row is called in messages instead of its number: a build's name, a hash's beginning."""
        unique = BY_NAME[table].unique if table in BY_NAME else None
        if unique is None or number is None:
            return str(number)
        (text,) = self._connection.execute(f"SELECT {unique} FROM main.{table} WHERE id = ?", (number,)).fetchone()
        return str(text) if table == "build" else str(text)[:12]


def _merged_ending(name: str, endings: Sequence[Ending], environments: int, designs: int, runs: int) -> dict[str, Any]:
    """The facts of the experiment ``name`` with the ``runs`` of all stores, and the most ``environments``.

    If all runs of a sweep that was to make them are there, results had no say in their number: they are such a sweep's.
    Else, if sweeps stopped by a rule, they are a sweep's that stops by it, whose intervals hold at any number of runs;
    that it has ended is true only of the runs that one of them ended with. StoreError if there are several rules.
    """
    planned = any(until is None and most == environments for _, most, until, _ in endings)
    rules = [(until, store) for store, _, until, _ in endings if until is not None]
    if not rules or (planned and runs == designs * environments):
        return {}
    first, first_store = rules[0]
    for until, store in rules:
        if until != first:
            raise StoreError(
                f'experiment "{name}": until is {json.dumps(until)} in {store}, {json.dumps(first)} in '
                f"{first_store}: no one rule says which runs there are; first sweep one of them without --until"
            )
    ended = any(until and (most, made) == (environments, runs) for _, most, until, made in endings)
    return {"until": first, **({"ended_runs": runs} if ended else {})}


def _checksum_of(name: str, *cells: Any) -> int:
    table = BY_NAME[name]
    return checksum(table, dict(zip(table.names, cells, strict=True)))


def _short(value: Any) -> str:
    text = value if isinstance(value, str) else json.dumps(value)
    return text if len(text) <= 80 else f"{text[:77]}…"
