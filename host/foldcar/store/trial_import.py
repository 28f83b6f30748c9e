"""Takes the trials of another store into a store, which may be of an earlier version of foldcar.

Runs can be simulated again; trials cannot. So every version reads the trials of the versions since OLDEST_TRIALS, with
their scenes, bodies and settings, corrections, photos and films, logs, and measured values.
"""

import contextlib
import shutil
import sqlite3
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from foldcar.store.check import missing_references
from foldcar.store.connection import connect_reading, transaction, writing
from foldcar.store.errors import StoreError, store_errors
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
    # These files are deleted again if taking the trials fails.
    new_files: list[Path] = [] if store_existed else [store]
    with contextlib.closing(connect_reading(other, OLDEST_TRIALS)) as source, _in_this_version(other, source) as trials:
        # The first missing reference is enough for an error.
        for missing in missing_references(trials):
            raise StoreError(f"{other}: {missing}")
        (trial_count,) = trials.execute("SELECT count(*) FROM trial").fetchone()
        try:
            # With FULL, the trials survive a power cut after this transaction.
            with writing(store, synchronous="FULL") as connection, store_errors(store), transaction(connection):
                uuids_before = {uuid for (uuid,) in connection.execute("SELECT uuid FROM trial")}
                merge = Merge(connection, store)
                merge.add(other, trials, [BY_NAME[name] for name in _ROWS_OF_TRIALS])
                for log, target in merge.logs.items():
                    target.parent.mkdir(parents=True, exist_ok=True)
                    new_files.append(target)
                    shutil.copyfile(log, target)
                ids_and_uuids = connection.execute("SELECT id, uuid FROM trial ORDER BY id").fetchall()
        except BaseException:
            for file in new_files:
                file.unlink(missing_ok=True)
            raise
    new_trials = [trial_id for trial_id, uuid in ids_and_uuids if uuid not in uuids_before]
    return TakenTrials(new=new_trials, known=trial_count - len(new_trials))


@contextlib.contextmanager
def _in_this_version(path: Path, source: sqlite3.Connection) -> Iterator[sqlite3.Connection]:
    """Yield a database in memory with the trials of a store, in the tables of this version."""
    with contextlib.closing(sqlite3.connect(":memory:", isolation_level=None)) as trials, store_errors(path):
        create_tables(trials)
        for table, condition in _ROWS_OF_TRIALS.items():
            # PRAGMA table_info returns a row for each column, with its name in the second place.
            source_columns = {column[1] for column in source.execute(f"PRAGMA table_info({table})")}
            # An earlier version may lack columns; they stay empty.
            common_columns = [column for column in BY_NAME[table].names if column in source_columns]
            if not common_columns:
                raise StoreError(f"{path}: is damaged: {table} is missing")
            column_list = ", ".join(common_columns)
            placeholders = ", ".join("?" for _ in common_columns)
            rows = source.execute(f"SELECT {column_list} FROM {table} WHERE {condition}")
            trials.executemany(f"INSERT INTO {table} ({column_list}) VALUES ({placeholders})", rows)
        yield trials
