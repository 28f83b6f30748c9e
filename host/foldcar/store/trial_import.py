"""Takes the trials of another store into a store, which may be of an earlier version of foldcar.

Runs can be simulated again; trials cannot. So every version reads the trials of the versions since OLDEST_TRIALS, with
their scenes, bodies and settings, corrections, photos and films, logs, and measured values.
"""

import contextlib
import sqlite3
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from foldcar.store.check import require_references
from foldcar.store.connection import connect_reading, transaction, writing
from foldcar.store.errors import StoreError, store_errors
from foldcar.store.log_copies import LogCopies
from foldcar.store.merge import Merge
from foldcar.store.tables import (
    BY_NAME,
    CORRECTION,
    ENVIRONMENT,
    MEASURED,
    MEDIA,
    OLDEST_TRIALS,
    SAMPLE,
    TRIAL,
    create_tables,
)

# The tables that are taken, each with the SQL condition for the rows that belong to trials. A table comes after those to
# which it refers.
_ROWS_OF_TRIALS = {
    "body": "id IN (SELECT body_id FROM trial)",
    "settings": "id IN (SELECT settings_id FROM trial)",
    "scene": "id IN (SELECT scene_id FROM trial UNION SELECT s.scene_id FROM sample s JOIN trial t "
    "ON t.environment_id = s.environment_id AND t.sample = s.sample)",
    ENVIRONMENT.name: "id IN (SELECT environment_id FROM trial)",
    # With its samples, foldcar recognises an environment whose program was changed without changing its scenes.
    SAMPLE.name: "(environment_id, sample) IN (SELECT environment_id, sample FROM trial)",
    TRIAL.name: "1",
    CORRECTION.name: "1",
    MEDIA.name: "1",
    MEASURED.name: "1",
}


@dataclass(frozen=True)
class TakenTrials:
    """What taking trials has changed: ``new`` are the numbers that the added trials have in the store.

    ``known`` is how many trials of the other store it had already.
    """

    new: list[int]
    known: int


def take_trials(store: Path, other: Path) -> TakenTrials:
    """Take the trials of the store ``other`` into ``store``, which is created if it does not exist.

    If both stores have a trial with the same UUID, the copy that was corrected later is kept. Logs are copied. Raises
    StoreError if ``other`` is not a store, is too old or too new, or contradicts ``store``; then nothing is taken.
    """
    store_existed = store.exists()
    if store_existed and store.samefile(other):
        raise StoreError(f"{store}: is the store itself; name another store")
    log_copies = LogCopies(store)
    with contextlib.closing(connect_reading(other, OLDEST_TRIALS)) as source, _in_this_version(other, source) as trials:
        require_references(other, trials)
        (trial_count,) = trials.execute("SELECT count(*) FROM trial").fetchone()
        try:
            # With FULL, the trials survive a power cut after this transaction.
            with writing(store, synchronous="FULL") as connection, store_errors(store), transaction(connection):
                earlier_numbers = _trial_numbers(connection)
                merge = Merge(connection, store, log_copies)
                merge.add(other, trials, [BY_NAME[name] for name in _ROWS_OF_TRIALS])
                log_copies.make()
                # A trial that is in both stores keeps its number.
                new_numbers = _trial_numbers(connection) - earlier_numbers
        except BaseException:
            log_copies.delete()
            if not store_existed:
                store.unlink(missing_ok=True)
            raise
    return TakenTrials(new=sorted(new_numbers), known=trial_count - len(new_numbers))


def _trial_numbers(connection: sqlite3.Connection) -> set[int]:
    """Return the numbers of the trials in a store."""
    return {number for (number,) in connection.execute("SELECT id FROM trial")}


@contextlib.contextmanager
def _in_this_version(path: Path, source: sqlite3.Connection) -> Iterator[sqlite3.Connection]:
    """Yield a database in memory with the trials of the store ``source`` at ``path``, in the tables of this version."""
    with contextlib.closing(sqlite3.connect(":memory:", isolation_level=None)) as trials, store_errors(path):
        create_tables(trials)
        for table, condition in _ROWS_OF_TRIALS.items():
            # An earlier version may lack columns; they stay empty.
            source_columns = _column_names(source, table)
            common_columns = [column for column in BY_NAME[table].names if column in source_columns]
            if not common_columns:
                raise StoreError(f"{path}: is damaged: {table} is missing")
            column_list = ", ".join(common_columns)
            placeholders = ", ".join("?" for _ in common_columns)
            rows = source.execute(f"SELECT {column_list} FROM {table} WHERE {condition}")
            trials.executemany(f"INSERT INTO {table} ({column_list}) VALUES ({placeholders})", rows)
        yield trials


def _column_names(connection: sqlite3.Connection, table: str) -> set[str]:
    """Return the names of a table's columns; none if the table does not exist."""
    # SQLite describes each column by a row: its index, its name, its type, and more.
    return {name for _index, name, *_further in connection.execute(f"PRAGMA table_info({table})")}
